"""grebe diff: what changed between two surveys of the same water."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np
import shapely

from grebe.cli import options, output
from grebe.cli.files import make_folder
from grebe.core.errors import InputError
from grebe.core.survey import Survey
from grebe.io.export.geotiff import write_bands
from grebe.io.store import SurveyFile
from grebe.mapping.difference import difference
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, QuantityMap, map_all
from grebe.report import canvas, map_figures
from grebe.workflow.checked import corrected_values, stored_lags

# Less common water than this is no map.
LEAST_WATER_M2 = 25.0


@click.command(name="diff")
@click.argument("earlier", type=options.EXISTING)
@click.argument("later", type=options.EXISTING)
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@options.json_option
def command(
    earlier: Path, later: Path, out: Path, resolution_m: float | None, as_json: bool
) -> None:
    """Map LATER less EARLIER where both surveys cover the water: GeoTIFF and picture each."""
    with SurveyFile.open(earlier) as one, SurveyFile.open(later) as other:
        water = _common_water(one.survey, other.survey)
        mapper = Mapper(water, make_grid(water, resolution_m))
        before, after = _maps(one, one.survey, mapper), _maps(other, one.survey, mapper)
        survey = one.survey
    common = [key for key in before if key in after]
    if not common:
        raise InputError(f"{earlier} and {later} have no mapped quantity in common.")
    make_folder(out)
    rows: dict[str, Any] = {}
    for key in common:
        change = difference(before[key], after[key])
        bands = {"difference": change.mean, "sd": change.sd}
        path = out / f"{key}_difference.tif"
        write_bands(path, before[key], survey.frame, bands, before[key].quantity.unit)
        canvas.save(
            map_figures.difference_figure(before[key], change), out / f"{key}_difference.png"
        )
        inside = before[key].grid.inside
        rows[key] = {
            "mean_difference": float(change.mean[inside].mean()),
            "changed_share": float(np.mean(change.clear[inside])),
            "file": str(path),
        }
    output.result(
        rows if as_json else {key: _sentence(row) for key, row in rows.items()},
        as_json=as_json,
        next_command=f"look at {out}",
    )


def _sentence(row: dict[str, Any]) -> str:
    share, mean = row["changed_share"], row["mean_difference"]
    return f"{mean:+.3g} on average; clear, node by node (95 %), on {share:.0%} of the area"


def _common_water(one: Survey, other: Survey) -> shapely.Polygon:
    """The largest part of the water that both surveys cover, in the first one's frame."""
    moved = one.frame.geometry_to_local(other.frame.geometry_to_wgs84(other.water))
    shared = shapely.intersection(one.water, moved, grid_size=1e-6)
    parts = [part for part in shapely.get_parts(shared) if isinstance(part, shapely.Polygon)]
    largest = max(parts, key=lambda part: part.area, default=None)
    if largest is None or largest.area < LEAST_WATER_M2:
        raise InputError("The two surveys do not cover any water in common.")
    return largest


def _maps(file: SurveyFile, base: Survey, mapper: Mapper) -> dict[str, QuantityMap]:
    """The maps of a survey on the common grid; all its samples count, outside it too."""
    table = file.samples()
    positions = base.frame.to_local(file.survey.frame.to_wgs84(table.positions))
    values = corrected_values(table, stored_lags(file))
    maps, left_out = map_all(mapper, positions, values, table.flags)
    for text in left_out:
        output.note(f"{file.path}: left out: {text}")
    return {one.quantity.key: one for one in maps}
