"""grebe plan: mesh a region into target sets and put them in order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.cli.accuracy_options import (
    accuracy_numbers,
    accuracy_options,
    cell_of,
    plan_surest,
    refuse_with_goal,
    refuse_without_goal,
)
from grebe.cli.sortie_numbers import sortie_numbers
from grebe.cli.sortie_options import fleet_settings, sortie_options, sortie_settings
from grebe.core.errors import UsageError
from grebe.core.plan_settings import PATTERNS, SHAPES, PlanSettings
from grebe.core.vessel import PRESETS, Vessel
from grebe.planning.planned import Planned, PlannedSorties
from grebe.planning.region import Region
from grebe.workflow.garbage_collection import without_collection
from grebe.workflow.plans import (
    plan_region,
    plan_warnings,
    read_region,
    write_expected,
    write_plan,
)
from grebe.workflow.vessels import vessel_of

DEFAULT_CELL_M = 5.0
DEFAULT_MARGIN_M = 1.0


@click.command(name="plan")
@click.argument("region", type=options.EXISTING)
@click.option("-o", "--output", "path", type=options.OUTPUT, required=True, help="Survey file.")
@click.option("--cell", "cell_m", type=float, help="Side of a square cell [m].  [default: 5]")
@click.option(
    "--shape",
    type=click.Choice(SHAPES),
    default="square",
    show_default=True,
    help="Shape of the cells; each has the area of the square.",
)
@click.option(
    "--core",
    type=float,
    default=1.0,
    show_default=True,
    help="Size of the part around each cell's middle that the boat must enter, as a share of the "
    "cell; less than 1 keeps it from cutting corners.",
)
@click.option(
    "--pattern",
    type=click.Choice(PATTERNS),
    default="free",
    show_default=True,
    help="Order of the cells: free takes the shortest time; the others are lanes along rows or "
    "columns.",
)
@click.option(
    "--angle",
    default="0",
    show_default=True,
    metavar="DEG|auto",
    help="Direction of the rows, clockwise from north; auto searches for the shortest route.",
)
@click.option(
    "--shore-margin",
    "shore_margin_m",
    type=float,
    help="Distance to keep from the shore [m].  [default: 1; 0 for the hull of a track]",
)
@click.option(
    "--no-go",
    type=options.EXISTING,
    multiple=True,
    help="File of polygons to stay out of; may be repeated.",
)
@click.option("--return", "returns", is_flag=True, help="Return to the start at the end.")
@click.option(
    "--current",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="Current that the plan assumes, towards north and east [m/s].",
)
@click.option(
    "--wind",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="Wind force on the boat that the plan assumes, towards north and east [N].",
)
@click.option(
    "--range",
    "range_m",
    type=float,
    help="Choose the cell size for a quantity whose variogram has this practical range [m].",
)
@click.option(
    "--accuracy",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.5,
    show_default=True,
    help="With --range: the map's standard deviation as a share of the quantity's own.",
)
@click.option(
    "--coast-tolerance",
    "coast_tolerance_m",
    type=float,
    help="Simplify the coastline by up to this distance, towards the water only [m].  "
    "[default: a tenth of a cell, beyond 10,000 vertices]",
)
@click.option("--minutes", type=float, help="Choose the cell size to fit this time [min].")
@click.option("--wh", "energy_wh", type=float, help="Choose the cell size to fit this energy [Wh].")
@click.option(
    "--speed",
    type=options.SPEED_WINDOW,
    default="1:2",
    show_default=True,
    help="Window of surge over ground in every target set [m/s].",
)
@click.option(
    "--vessel",
    "vessels",
    default=("spyboat",),
    multiple=True,
    show_default=True,
    help=f"The boat: {', '.join(sorted(PRESETS))}, or a TOML file of your own; for a fleet of "
    "different boats, once for each.",
)
@click.option(
    "--start",
    "starts",
    type=options.LON_LAT,
    multiple=True,
    help="Where the boat starts [deg]; for a fleet, once for each boat.",
)
@click.option(
    "--feature", metavar="NAME|N", help="Which lake of REGION to survey, if it holds several."
)
@click.option(
    "--islands",
    type=click.Choice(("named", "all", "none")),
    default="named",
    show_default=True,
    help="Which polygons of REGION that lie within another one are land: those whose name, folder "
    "or attribute says island, all, or none.",
)
@click.option(
    "--crs",
    metavar="EPSG:CODE",
    help="Coordinates of REGION and --no-go files that do not name their own, such as EPSG:25832.",
)
@accuracy_options
@sortie_options
@options.column_options
@options.quantities_option
@options.force_option
@options.json_option
@without_collection()
def command(
    region: Path,
    path: Path,
    no_go: tuple[Path, ...],
    vessels: tuple[str, ...],
    starts: tuple[tuple[float, float], ...],
    feature: str | None,
    force: bool,
    as_json: bool,
    columns: tuple[str, ...],
    header_from: Path | None,
    quantities_file: Path | None,
    **asked: Any,
) -> None:
    """Plan a survey of REGION: GeoJSON, KML, KMZ, GPX, a Shapefile, a GeoPackage, or a CSV track
    whose convex hull is the region.

    Writes the survey file and, beside it, a picture of the plan. The boat stays on the water:
    transit sets lead it around land, within corridors that the file holds.
    """
    options.refuse_same(region, options.checked_output(path))
    boats = [vessel_of(one) for one in vessels]
    boat = boats[0]
    refuse_without_goal(asked)
    refuse_with_goal(asked, len(vessels))
    settings = _settings(asked, starts, boats, region)
    start = starts[0] if starts else None
    water, notes = read_region(
        region,
        columns=options.track_columns(columns, asked),
        header_from=header_from,
        feature=feature,
        islands=asked["islands"],
        crs=asked["crs"],
        is_crs_of_others=bool(no_go),
    )
    for text in notes:
        output.note(f"{region}: {text}")
    surest = None
    if asked["goal"] == "accuracy":
        surest = plan_surest(asked, water, boat, settings, start, no_go, quiet=as_json)
        planned = surest.best.planned
    else:
        planned = _planned(asked, water, boat, settings, start, no_go, quiet=as_json)
    picture = write_plan(planned, path, quantities_file=quantities_file, force=force)
    for text in (*planned.notes, *plan_warnings(planned.survey)):
        output.note(f"note: {text}")
    numbers = plan_numbers(planned)
    if surest is not None:
        numbers |= accuracy_numbers(surest, write_expected(surest.best, path))
    known = f" --water {output.quoted(region)}" if region.suffix.lower() == ".csv" else ""
    output.result(
        {**numbers, "file": str(path), "picture": str(picture)},
        as_json=as_json,
        next_command=f"grebe run {output.quoted(path)}{known}",
    )


def _planned(
    asked: dict[str, Any],
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start: tuple[float, float] | None,
    no_go: tuple[Path, ...],
    *,
    quiet: bool,
) -> Planned:
    """Plan, with a progress bar for the search for sorties."""
    searches = settings.sorties is not None
    with output.Countdown("rounds", 1, quiet=quiet) if searches else nullcontext() as bar:
        return plan_region(
            region,
            vessel,
            settings,
            start_lonlat=start,
            no_go=no_go,
            crs=asked["crs"],
            on_done=None if bar is None else bar.update,
        )


def _settings(
    asked: dict[str, Any],
    starts: tuple[tuple[float, float], ...],
    vessels: Sequence[Vessel],
    region: Path,
) -> PlanSettings:
    """The plan's settings from the options."""
    minutes, energy_wh = asked["minutes"], asked["energy_wh"]
    low, high = asked["speed"]
    return PlanSettings(
        cell_m=_cell_m(asked),
        shape=asked["shape"],
        core=asked["core"],
        pattern=asked["pattern"],
        angle_deg=_angle_deg(asked["angle"]),
        speed_min_mps=low,
        speed_max_mps=high,
        shore_margin_m=_margin_m(asked["shore_margin_m"], region),
        coast_tolerance_m=asked["coast_tolerance_m"],
        returns=asked["returns"],
        weather=options.weather_of(asked["current"], asked["wind"]),
        minutes=minutes,
        energy_wh=energy_wh,
        sorties=sortie_settings(
            asked["sortie_battery_wh"], asked["sortie_minutes"], asked["reserve"], asked["harbours"]
        ),
        fleet=fleet_settings(asked["boats"], asked["apart_m"], starts, vessels),
    )


def _cell_m(asked: dict[str, Any]) -> float | None:
    """The cell size [m]: as given, or for a map of --accuracy; None if a budget chooses it."""
    if asked["goal"] == "accuracy":
        return cell_of(asked)
    cell_m, range_m, accuracy = asked["cell_m"], asked["range_m"], asked["accuracy"]
    budgeted = asked["energy_wh"] if asked["minutes"] is None else asked["minutes"]
    if range_m is None:
        return DEFAULT_CELL_M if cell_m is None and budgeted is None else cell_m
    if cell_m is not None:
        raise UsageError("--range chooses the cell size and --cell sets it; give one of them.")
    if not 0 < range_m < math.inf:
        raise UsageError(f"--range {range_m:g}: a range is a positive number of metres.")
    from grebe.mapping.design import pitch_for_accuracy

    return round(pitch_for_accuracy(range_m, accuracy), 2)


def _margin_m(given_m: float | None, region: Path) -> float:
    """The shore margin [m]: as given, or the default, which is 0 for a track's hull, as that has no
    shore.
    """
    if given_m is not None:
        return given_m
    return 0.0 if region.suffix.lower() == ".csv" else DEFAULT_MARGIN_M


def _angle_deg(text: str) -> float | None:
    """Degrees, or None for `auto`."""
    if text == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--angle {text!r} is neither a number of degrees nor 'auto'.") from None


def plan_numbers(planned: Planned) -> dict[str, Any]:
    """Return the numbers of a plan that the command prints."""
    survey, outcome, check = planned.survey, planned.outcome, planned.check
    numbers: dict[str, Any] = {
        "name": survey.name,
        "targets": len(survey.targets),
        "transits": sum(target.kind == "transit" for target in survey.targets),
        "cell_m": round(outcome.cell_m, 3),
        "angle_deg": round(outcome.angle_deg, 1),
        "origin": options.place_text(survey.frame),
        "area_m2": round(survey.water.area, 1),
        "coverage": round(check.coverage, 6),
        "outside_m2": round(check.outside_m2, 6),
        "length_m": round(outcome.length_m, 1),
        "turns": outcome.turns,
        "time_s": round(outcome.time_s, 1),
        "energy_wh": round(outcome.energy_wh, 2),
        "lower_bound_m": round(outcome.lower_bound_m, 1),
        "gap": round(outcome.gap, 4),
        "order_from": outcome.method,
    }
    if isinstance(planned, PlannedSorties):
        numbers |= sortie_numbers(planned)
        # These hold for one route through all cells; several routes may be shorter together.
        del numbers["lower_bound_m"], numbers["gap"]
    return numbers
