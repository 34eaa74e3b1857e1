"""From where a mission sets out: at the plan's start, or where a recorded one was cut off."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from grebe.core.errors import PlanError, SurveyFileError
from grebe.core.events import State
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile

# A mission that goes on begins this long after the last row of the track, at the earliest.
AFTER_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Departure:
    """What a mission needs to know before it begins.

    `state` (6,) where the boat is expected, `reached` the number of targets reached before,
    `started` the UTC time of its first estimate, `clears` whether a recorded mission is to be
    forgotten; `quantities` those that the survey file declares.
    """

    survey: Survey
    vessel: Vessel
    state: State
    reached: int
    started: datetime
    clears: bool
    quantities: Quantities = LIMNOLOGICAL


def prepare(
    survey_file: SurveyFile, now: datetime, *, resume: bool = False, force: bool = False
) -> Departure:
    """Return from where the mission of a survey file sets out; nothing is changed yet.

    With `resume` it goes on where and when the recorded track ends, and what was reached stays
    reached; with `force` it begins anew. Raises `PlanError` for a survey without targets and
    `SurveyFileError` for one that has been run and is neither resumed nor forced.
    """
    survey = survey_file.survey
    if survey.vessel is None or survey.start is None or not survey.targets:
        raise PlanError(f"{survey_file.path} has no targets to steer to; plan a survey first.")
    reached = survey_file.progress().reached
    track = survey_file.track()
    if len(track) and not (resume or force):
        raise SurveyFileError(
            f"{survey_file.path} holds a mission already ({reached} of {len(survey.targets)} "
            "targets reached); resume it, or begin anew by force.",
            settings=("resume", "force"),
        )
    state, started = survey.start.at_rest(), now
    if len(track) and resume:
        north, east, heading, surge, sway, yaw_rate = track.states[-1].tolist()
        state = (north, east, heading, surge, sway, yaw_rate)
        # Simulated time runs ahead of the clock: the new part must not begin before the old ends.
        started = max(now, track.times[-1] + timedelta(seconds=AFTER_S))
    return Departure(
        survey=survey,
        vessel=survey.vessel,
        state=state,
        reached=reached if resume else 0,
        started=started,
        clears=len(track) > 0 and not resume,
        quantities=survey_file.quantities,
    )
