"""Identify a boat: drive the manoeuvre, read a drive, fit the model, and write the result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from grebe.core.errors import InputError, PlanError
from grebe.core.events import State
from grebe.core.vessel import Vessel
from grebe.identification.free_water import circle_in
from grebe.identification.identify import DEFAULT, IdentifySettings, identify
from grebe.identification.manoeuvre import DURATION_S, Circle, Manoeuvre, programme
from grebe.identification.result import FittedValue, Identification
from grebe.io.export.drive_csv import DriveCsv
from grebe.io.export.vessel import write_vessel
from grebe.io.readers.drive import read_drive
from grebe.io.store import SurveyFile
from grebe.links.base import Order, as_driven
from grebe.links.recording import RecordingLink
from grebe.mission.departure import Departure
from grebe.mission.manoeuvre import ManoeuvreEnd, sail_manoeuvre
from grebe.mission.safety.watchdog import guarded, journal_beside
from grebe.report import canvas
from grebe.report.identification_figures import identification_figure
from grebe.workflow.run import BoatAt

# The speed limit when none is given: a share of the vessel's top speed, and no more than this
# [m/s].
SPEED_SHARE, SPEED_MAX_MPS = 0.8, 2.0


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSettings:
    """Settings of the manoeuvre.

    `radius_m` of the circle (None: the largest that is free), `speed_max_mps` (None: four fifths of
    the vessel's top speed, 2 at most), `duration_s`.
    """

    radius_m: float | None = None
    speed_max_mps: float | None = None
    duration_s: float = DURATION_S


@dataclass(frozen=True, kw_only=True)
class Driven:
    """A manoeuvre that was driven: where, the speed limit, how it ended, and notes."""

    circle: Circle
    speed_max_mps: float
    end: ManoeuvreEnd
    notes: tuple[str, ...]


class _ThrottleSink:
    """Turns the states and orders of a link into rows of a log."""

    def __init__(self, log: DriveCsv, vessel: Vessel) -> None:
        self._log = log
        self._vessel = vessel

    def state(self, time_s: float, state: State) -> None:
        self._log.state(time_s, state)

    def order(self, time_s: float, order: Order) -> None:
        port, starboard = map(self._vessel.throttle_of, order.thrusts)
        self._log.command(time_s, (port, starboard))


def drive_manoeuvre(
    survey_path: Path,
    boat_at: BoatAt,
    to: Path,
    now: datetime,
    settings: ManoeuvreSettings | None = None,
    *,
    vessel: Vessel | None = None,
    force: bool = False,
) -> Driven:
    """Drive the manoeuvre in the water of a survey and log it as CSV; the survey file is unchanged.

    Raises `PlanError` if there is no room, and what opening the link raises.
    """
    wanted = settings or ManoeuvreSettings()
    with SurveyFile.open(survey_path) as file:
        survey, quantities = file.survey, file.quantities
    boat = vessel or survey.vessel
    if boat is None or survey.start is None:
        raise PlanError(
            f"{survey_path} has no vessel and no start; plan a survey of the water first."
        )
    start = survey.start
    circle = circle_in(survey, (start.north_m, start.east_m), wanted.radius_m)
    speed = wanted.speed_max_mps or min(SPEED_SHARE * boat.speed_max_mps, SPEED_MAX_MPS)
    manoeuvre = Manoeuvre(boat, circle, speed_max_mps=speed, legs=programme(wanted.duration_s))
    survey = replace(survey, vessel=boat)
    departure = Departure(
        survey=survey,
        vessel=boat,
        state=start.at_rest(),
        reached=0,
        started=now,
        clears=False,
        quantities=quantities,
    )
    with DriveCsv(to, force=force) as log:
        link = boat_at(departure)
        by_motion = as_driven(link).holds_motion
        recorded = RecordingLink(link, _ThrottleSink(log, boat))
        try:
            with guarded(link, journal_beside(survey_path)) as guards:
                end = sail_manoeuvre(survey, manoeuvre, recorded, guards)
        except BaseException:
            link.close()
            raise
    notes = (
        ("this boat was steered by speed, so the thrusts in the log are only requests: identify it "
         "from the autopilot's own log",)
        if by_motion
        else ()
    )  # fmt: skip
    return Driven(circle=circle, speed_max_mps=speed, end=end, notes=notes)


def identify_file(
    path: Path, preset: Vessel, settings: IdentifySettings = DEFAULT, *, name: str = ""
) -> Identification:
    """Identify the boat of a log, and name it, by default after the log."""
    found = identify(read_drive(path), preset, settings)
    return replace(found, vessel=replace(found.vessel, name=name or path.stem))


def write_identification(
    found: Identification, to: Path, *, picture: Path | None = None, force: bool = False
) -> Path:
    """Write the vessel as TOML and its picture beside it; return the picture's path."""
    drawn = picture or to.with_suffix(".png")
    if drawn.exists() and not force:
        raise InputError(
            f"{drawn} exists already; give another name, or replace it by force.",
            settings=("force",),
        )
    write_vessel(
        found.vessel,
        to,
        comments={one.name: _comment(one) for one in found.parameters},
        head=_head(found),
        force=force,
    )
    canvas.save(identification_figure(found), drawn)
    return drawn


def _comment(one: FittedValue) -> str:
    if not one.is_determined:
        return f"+- {one.sd:.2g}: not determined by this drive"
    size = abs(one.value)
    share = f" ({100 * one.sd / size:.2g} %)" if size > one.sd else ""
    return f"+- {one.sd:.2g}{share}"


def _head(found: Identification) -> list[str]:
    """Return the text above the numbers: latency, accuracy of the predictions, and notes."""
    check = found.hold_out
    latency = found["latency_s"]
    return [
        f"{found.vessel.source} Standard errors follow the numbers.",
        f"From a command to its thrust {latency.value:.3f} s pass (+- {latency.sd:.2g}), in "
        "addition to the thrusters' lag.",
        f"Prediction {check.horizon_s:g} s ahead on parts that the fit did not use ({check.pieces} "
        f"pieces), rms: surge {check.fitted[0]:.3f} m/s, sway {check.fitted[1]:.3f} m/s, yaw rate "
        f"{math.degrees(check.fitted[2]):.2f} deg/s; before: {check.preset[0]:.3f}, "
        f"{check.preset[1]:.3f}, {math.degrees(check.preset[2]):.2f}.",
        *(f"Note: {text}." for text in found.notes),
    ]
