"""grebe identify: fit a boat's model to a recorded drive, and drive the manoeuvre for it."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.core.errors import IncompleteError, UsageError
from grebe.core.vessel import PRESETS, vessel_named
from grebe.identification.identify import IdentifySettings
from grebe.identification.result import FittedValue, Identification
from grebe.links.simulated import EstimateErrors
from grebe.workflow.boats import SIMULATED, Harbour, boat_named
from grebe.workflow.identification import (
    ManoeuvreSettings,
    drive_manoeuvre,
    identify_file,
    write_identification,
)
from grebe.workflow.simulated import SimulatedWorld
from grebe.workflow.vessels import vessel_of

USUAL_VESSEL = "spyboat"


@click.command(name="identify")
@click.argument("file", type=options.EXISTING)
@click.option(
    "-o",
    "--output",
    "path",
    type=options.OUTPUT,
    help="Output file: the vessel (TOML), or with --manoeuvre the log of the drive (CSV).",
)
@click.option(
    "--vessel",
    help=f"First estimate of the boat: a TOML file, or one of {', '.join(sorted(PRESETS))}.  "
    f"[default: {USUAL_VESSEL}; with --manoeuvre the survey's]",
)
@click.option("--name", help="Name of the vessel.  [default: the log's]")
@click.option(
    "--bollard",
    "bollard_n",
    type=float,
    help="Measured pull of one thruster at full command ahead [N]; sets the scale of all forces.",
)
@click.option(
    "--piece",
    "piece_s",
    type=float,
    default=10.0,
    show_default=True,
    help="Length of the pieces of the drive that the fit predicts [s].",
)
@click.option(
    "--manoeuvre",
    is_flag=True,
    help="Drive a short manoeuvre in the water of the survey FILE and log it.",
)
@click.option(
    "--link",
    "url",
    default=SIMULATED,
    show_default=True,
    help="With --manoeuvre: the boat, as for grebe run.",
)
@click.option("--radius", "radius_m", type=float, help="Radius of the manoeuvre's circle [m].")
@click.option(
    "--speed-limit", "speed_max_mps", type=float, help="Highest speed of the manoeuvre [m/s]."
)
@click.option(
    "--seconds", "duration_s", type=click.FloatRange(90, 1800), default=180.0, show_default=True,
    help="Duration of the manoeuvre.",
)  # fmt: skip
@click.option("--yes", is_flag=True, help="Arm a real boat without asking, for scripts.")
@click.option(
    "--mismatch",
    type=click.FloatRange(0, 1, max_open=True),
    default=0.0,
    show_default=True,
    help="Share by which the simulated boat may differ from the first estimate.",
)
@click.option(
    "--noise",
    type=click.FloatRange(min=0),
    default=0.0,
    show_default=True,
    help="Standard deviation of the simulated boat's velocities [m/s]; that of positions is ten "
    "times as large in metres.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True,
              help="Seed of the simulated boat.")  # fmt: skip
@options.force_option
@options.json_option
def command(
    file: Path,
    path: Path | None,
    vessel: str | None,
    name: str | None,
    bollard_n: float | None,
    piece_s: float,
    manoeuvre: bool,
    force: bool,
    as_json: bool,
    **drive: Any,
) -> None:
    """Fit a boat's model to FILE, a drive with its commands: CSV, a survey file, or ArduPilot's
    .tlog or .bin.

    Fits masses, drags, the thrust curve, lag and latency, with standard errors, and tests them on
    parts of the drive that the fit has not seen. Writes a vessel for grebe plan --vessel and a
    picture beside it.
    """
    ending = ".csv" if manoeuvre else ".toml"
    to = options.checked_output(path or file.with_suffix(ending))
    options.refuse_same(file, to)
    if to.suffix.lower() != ending:
        raise UsageError(f"{to}: the name of the output must end in {ending}.")
    if manoeuvre:
        _drive(file, to, vessel, force=force, as_json=as_json, **drive)
        return
    settings = IdentifySettings(piece_s=piece_s, bollard_n=bollard_n)
    preset = vessel_of(vessel) if vessel else vessel_named(USUAL_VESSEL)
    found = identify_file(file, preset, settings, name=name or "")
    picture = write_identification(found, to, force=force)
    for text in found.notes:
        output.note(f"note: {text}")
    output.result(
        _numbers(found, as_json=as_json) | {"file": str(to), "picture": str(picture)},
        as_json=as_json,
        next_command=f"grebe plan LAKE.geojson --vessel {output.quoted(to)} -o survey.gpkg",
    )


def _drive(
    survey: Path,
    to: Path,
    vessel: str | None,
    *,
    url: str,
    radius_m: float | None,
    speed_max_mps: float | None,
    duration_s: float,
    yes: bool,
    mismatch: float,
    noise: float,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    errors = EstimateErrors(position_m=10 * noise, heading_rad=0.3 * noise, velocity_mps=noise)
    world = SimulatedWorld(mismatch=mismatch, errors=errors, seed=seed)
    driven = drive_manoeuvre(
        survey,
        boat_named(url, Harbour(world=world, confirm=output.confirmation(yes=yes))),
        to,
        datetime.now(UTC),
        ManoeuvreSettings(radius_m=radius_m, speed_max_mps=speed_max_mps, duration_s=duration_s),
        vessel=vessel_of(vessel) if vessel else None,
        force=force,
    )
    for text in driven.notes:
        output.note(f"note: {text}")
    circle = driven.circle
    output.result(
        {
            "log": str(to),
            "circle": f"{circle.radius_m:g} m about {circle.north_m:.0f} m north, "
            f"{circle.east_m:.0f} m east",
            "speed_limit_mps": round(driven.speed_max_mps, 2),
            "complete": driven.end.complete,
        },
        as_json=as_json,
        next_command=f"grebe identify {output.quoted(to)}"
        + (f" --vessel {output.quoted(vessel)}" if vessel else ""),
    )
    if not driven.end.complete:
        raise IncompleteError(f"The manoeuvre ended early: {driven.end.message}.")


def _numbers(found: Identification, *, as_json: bool) -> dict[str, Any]:
    check = found.hold_out
    if as_json:
        return {
            "parameters": {one.name: _row(one) for one in found.parameters},
            "derived": {one.name: _row(one) for one in found.derived},
            "noise": found.noise.tolist(),
            "hold_out": {
                "horizon_s": check.horizon_s,
                "pieces": check.pieces,
                "fitted": check.fitted.tolist(),
                "preset": check.preset.tolist(),
                "fitted_drift_m": check.fitted_drift_m,
                "preset_drift_m": check.preset_drift_m,
            },
            "notes": list(found.notes),
        }
    rows = {one.name: _text(one) for one in (*found.parameters, *found.derived)}
    after, before = (
        f"{rms[0]:.3f} m/s, {rms[1]:.3f} m/s, {math.degrees(rms[2]):.2f} deg/s, {drift:.2f} m"
        for rms, drift in (
            (check.fitted, check.fitted_drift_m),
            (check.preset, check.preset_drift_m),
        )
    )
    rows[f"{check.horizon_s:g} s ahead, held out"] = after
    rows["the same, by the first estimate"] = before
    return rows


def _row(one: FittedValue) -> dict[str, Any]:
    return {
        "value": one.value,
        "sd": one.sd,
        "unit": one.unit,
        "before": one.before,
        "told": one.is_determined,
    }


def _text(one: FittedValue) -> str:
    before = "" if one.before is None or one.of_the_day else f", before {one.before:.4g}"
    doubt = "" if one.is_determined or one.of_the_day else " (not determined)"
    return f"{one.text}{before}{doubt}"
