"""grebe map: draw the maps of what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.cli.files import make_folder
from grebe.errors import InputError
from grebe.export.netcdf import write_netcdf
from grebe.mapping.maps import QuantityMap
from grebe.report import figures
from grebe.report.page import ReportData, gather
from grebe.store import SurveyFile


@click.command(name="map")
@click.argument("file", type=options.EXISTING)
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@options.json_option
def command(file: Path, out: Path, resolution_m: float | None, as_json: bool) -> None:
    """Map every quantity of FILE: map.nc (CF NetCDF) and one picture each."""
    with SurveyFile.open(file) as survey_file:
        data = gather(survey_file, resolution_m)
    written = write_maps(data, out)
    for text in data.left_out:
        output.note(f"left out: {text}")
    output.result(
        {
            "maps": [_numbers(one) for one in data.maps]
            if as_json
            else [one.quantity.label for one in data.maps],
            "left_out": list(data.left_out),
            "files": [str(path) for path in written],
        },
        as_json=as_json,
        next_command=f"grebe report {file} -o report.html",
    )


def write_maps(data: ReportData, out: Path) -> list[Path]:
    """Write map.nc and the pictures; `InputError` when there is nothing to map."""
    if not data.maps:
        raise InputError(f"No quantity can be mapped: {'; '.join(data.left_out)}.")
    make_folder(out)
    netcdf = out / "map.nc"
    write_netcdf(netcdf, data.maps, data.survey.frame, _attributes(data))
    return [netcdf, *_pictures(data.maps, data, out)]


def _pictures(maps: Sequence[QuantityMap], data: ReportData, out: Path) -> list[Path]:
    return [
        figures.save(
            figures.map_figure(data.survey, one, data.samples), out / f"{one.quantity.key}.png"
        )
        for one in maps
    ]


def _attributes(data: ReportData) -> dict[str, str]:
    return {
        "title": f"Surface water of {data.survey.name}",
        "source": f"Grebe {data.meta['software_version']}, {data.meta.get('water', 'measured')}",
        "history": f"mapped from survey {data.meta.get('survey_id', '')}",
        "comment": data.meta.get("note", ""),
    }


def _numbers(one: QuantityMap) -> dict[str, Any]:
    model, validation = one.interpolator.model, one.validation
    return {
        "quantity": one.quantity.key,
        "samples": one.samples,
        "flagged": one.flagged,
        "method": one.method,
        "reason": one.reason,
        "variogram": {
            "kind": model.kind,
            "nugget": model.nugget,
            "partial_sill": model.sill,
            "range_m": model.range_m,
            "practical_range_m": model.practical_range_m,
            "reason": one.fit.reason,
        },
        "validation": vars(validation) if validation else None,
    }
