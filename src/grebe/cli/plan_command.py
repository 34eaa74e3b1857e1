"""grebe plan: mesh a region into target sets and put them in order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import shapely

from grebe.cli import options, output
from grebe.cli.files import create_survey_file
from grebe.errors import InputError
from grebe.planning.planner import PlanSettings, plan_survey
from grebe.planning.region import clean_region
from grebe.readers.outline import read_outline
from grebe.report import figures
from grebe.survey import Survey
from grebe.vessel import PRESETS, vessel_named


@click.command(name="plan")
@click.argument("region", type=options.EXISTING)
@click.option("-o", "--output", "path", type=options.OUTPUT, required=True, help="Survey file.")
@click.option("--cell", "cell_m", type=float, default=5.0, show_default=True, help="Side [m].")
@click.option(
    "--angle",
    "angle_deg",
    type=float,
    default=0.0,
    show_default=True,
    help="Direction of the rows, clockwise from north [deg].",
)
@click.option(
    "--speed",
    type=options.SPEED_WINDOW,
    default="1:2",
    show_default=True,
    help="Window of surge over ground in every target set [m/s].",
)
@click.option(
    "--vessel",
    default="spyboat",
    show_default=True,
    help=f"One of {', '.join(sorted(PRESETS))}.",
)
@click.option("--start", type=options.LON_LAT, help="Where the boat starts [deg].")
@options.column_options
@options.force_option
@options.json_option
def command(
    region: Path,
    path: Path,
    cell_m: float,
    angle_deg: float,
    speed: tuple[float, float],
    vessel: str,
    start: tuple[float, float] | None,
    force: bool,
    as_json: bool,
    header_from: Path | None,
    **columns: str | None,
) -> None:
    """Plan a survey of REGION: GeoJSON, or a CSV track whose convex hull is the region.

    Writes the survey file and a picture of the plan beside it.
    """
    options.refuse_same(region, options.checked_output(path))
    picture = path.with_suffix(".png")
    if picture.is_dir():
        raise InputError(f"{picture}, where the picture of the plan would go, is a folder.")
    boat = vessel_named(vessel)
    outline = read_outline(region, options.track_columns(columns), header_from)
    for text in outline.notes:
        output.note(f"{region}: {text}")
    settings = PlanSettings(
        cell_m=cell_m, angle_deg=angle_deg, speed_min_mps=speed[0], speed_max_mps=speed[1]
    )
    survey = plan_survey(clean_region(outline.geometry, outline.name), boat, settings, start)
    create_survey_file(path, survey, force=force).close()
    figures.save(figures.plan_figure(survey), picture)
    for text in plan_warnings(survey):
        output.note(f"note: {text}")
    water = f" --water {region}" if region.suffix.lower() == ".csv" else ""
    output.result(
        {**plan_numbers(survey), "file": str(path), "picture": str(picture)},
        as_json=as_json,
        next_command=f"grebe run {path}{water}",
    )


def plan_warnings(survey: Survey) -> list[str]:
    """What a field team should know before it goes out."""
    warnings: list[str] = []
    start, vessel = survey.start, survey.vessel
    if start is not None:
        away = survey.water.distance(shapely.Point(start.north_m, start.east_m))
        if away > 1.0:
            warnings.append(f"the start lies {away:.0f} m outside the region; is it on water?")
    fastest = max(target.set.speed_max_mps for target in survey.targets)
    if vessel is not None and fastest > vessel.speed_max_mps:
        warnings.append(
            f"the window goes up to {fastest:g} m/s, and {vessel.name} makes "
            f"{vessel.speed_max_mps:.2f} m/s at full thrust"
        )
    return warnings


def plan_numbers(survey: Survey) -> dict[str, Any]:
    """Return what a plan reports of itself."""
    return {
        "name": survey.name,
        "targets": len(survey.targets),
        "origin": f"{survey.frame.origin_lat_deg:.5f} N, {survey.frame.origin_lon_deg:.5f} E",
        "area_m2": round(survey.water.area, 1),
        "coverage": round(survey.coverage, 6),
        "length_m": round(survey.route_length_m, 1),
    }
