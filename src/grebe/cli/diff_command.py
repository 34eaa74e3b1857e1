"""grebe diff: map changes and trends between surveys of the same water."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from grebe.cli import options, output
from grebe.core.errors import InputError, UsageError
from grebe.mapping.bathymetry import WATER_DEPTH
from grebe.mapping.series.trend import LEAST_YEARS_FOR_SEASON, YEAR_S
from grebe.workflow.differences import compare_surveys, write_changes
from grebe.workflow.series import map_series, write_series


@click.command(name="diff")
@click.argument("surveys", type=options.EXISTING, nargs=-1, required=True, metavar="SURVEY...")
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@click.option(
    "--seasonal",
    is_flag=True,
    help="Also fit an annual wave; needs at least six surveys over two years.",
)
@options.force_option
@options.json_option
def command(
    surveys: tuple[Path, ...],
    out: Path,
    resolution_m: float | None,
    seasonal: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Map the changes between surveys, where all of them cover the water.

    Two surveys give the second minus the first, as a GeoTIFF and a picture for each quantity. Three
    or more, in any order, give the trend at each place with the probability of one as large by
    chance, and series.nc with all maps.
    """
    if len(surveys) == 1:
        raise UsageError("One survey is given; a change takes two, a trend three or more.")
    if (
        not force
        and out.is_dir()
        and (any(out.glob("*_difference.tif")) or any(out.glob("*_trend.tif")))
    ):
        raise InputError(f"{out} contains changes already; give another folder, or --force.")
    if len(surveys) == 2:
        if seasonal:
            raise UsageError(
                "Two surveys are too few to distinguish a season from a trend.",
                settings=("seasonal",),
            )
        rows = _differences(surveys[0], surveys[1], out, resolution_m)
        sentence = _of_change
    else:
        rows = _trends(surveys, out, resolution_m, seasonal=seasonal, quiet=as_json)
        sentence = _of_trend
    output.result(
        rows if as_json else {str(row["label"]): sentence(row) for row in rows.values()},
        as_json=as_json,
        next_command=f"look at {out}",
    )


def _differences(
    earlier: Path, later: Path, out: Path, resolution_m: float | None
) -> dict[str, dict[str, Any]]:
    changes = compare_surveys(earlier, later, resolution_m)
    _tell(changes.left_out)
    if changes.days[1] < changes.days[0]:
        output.note(f"{later} ({changes.days[1]}) is older than {earlier} ({changes.days[0]})")
    output.note(
        "the differences include those between the sensors of the two surveys, in calibration and "
        "in position on the boat; their standard deviations do not"
    )
    if WATER_DEPTH in changes.by_quantity:
        output.note(
            "water depth: the water level and the errors of a sounder change faster than the bed"
        )
    written = write_changes(changes, out)
    rows: dict[str, dict[str, Any]] = {}
    for key, change in changes.by_quantity.items():
        inside = change.before.grid.inside
        rows[key] = {
            "label": change.before.quantity.label,
            "unit": change.before.quantity.unit,
            "mean_difference": float(change.difference.mean[inside].mean()),
            "changed_share": float(np.mean(change.difference.clear[inside])),
            "file": str(written[key]),
        }
    return rows


def _trends(
    surveys: tuple[Path, ...],
    out: Path,
    resolution_m: float | None,
    *,
    seasonal: bool,
    quiet: bool,
) -> dict[str, dict[str, Any]]:
    with output.Countdown("surveys", len(surveys), quiet=quiet) as countdown:
        series = map_series(surveys, resolution_m, seasonal=seasonal, on_done=countdown.update)
    _tell(series.left_out)
    years = float(np.ptp(series.spans_s)) / YEAR_S
    if not seasonal and years < LEAST_YEARS_FOR_SEASON:
        output.note(f"the surveys span only {years:.1f} years: an apparent trend may be the season")
    written = write_series(series, out)
    return {
        key: {
            "label": one.first.quantity.label,
            "unit": one.first.quantity.unit,
            "trend_per_year": one.trend.of_mean.slope,
            "half_width_95": one.trend.of_mean.half_width,
            "p": one.trend.of_mean.p,
            "p_adjusted": one.mean_p,
            "days": len(one.times_s),
            "changed_share": float(np.mean(one.trend.clear)),
            "file": str(written[key]),
        }
        for key, one in series.by_quantity.items()
    }


def _tell(left_out: tuple[str, ...]) -> None:
    for text in left_out:
        output.note(f"left out: {text}")


def _of_change(row: dict[str, Any]) -> str:
    share, mean = row["changed_share"], row["mean_difference"]
    unit = f" {row['unit']}" if row["unit"] else ""
    return f"{mean:+.3g}{unit} on average; clear, node by node (95 %), on {share:.0%} of the area"


def _of_trend(row: dict[str, Any]) -> str:
    unit = f" {row['unit']}" if row["unit"] else ""
    return (
        f"{row['trend_per_year']:+.3g} ± {row['half_width_95']:.2g}{unit} a year on average (95 %; "
        f"p {row['p_adjusted']:.2g} among the quantities); clear on {row['changed_share']:.0%} "
        f"of the area; surveys of {row['days']} days"
    )
