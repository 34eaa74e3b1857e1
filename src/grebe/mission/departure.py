"""Where a mission sets out: at the plan's start, or where a recorded mission was cut off.

A mission reads the computer's clock once, when it sets out, and then uses the link's time, so that
no step of the clock disturbs it. A wrong clock can therefore matter only here. It is reported, and
the times in one file never run back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from grebe.core.errors import PlanError, SurveyFileError, UsageError
from grebe.core.events import State
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.revision import Sortie, as_planned, survey_of
from grebe.core.survey import Survey, is_simulated
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile
from grebe.io.store.tables import TrackEnd
from grebe.io.store.timestamps import parse_time
from grebe.mission.consumption import AT_HOME, NOTHING, Consumption, consumption_since_harbour

# A resumed mission begins at least this long after everything that is recorded [s].
AFTER_S = 0.1
# A boat within this distance of its start is there already, and keeps its own heading [m].
SAME_PLACE_M = 1.0
# A clock that is later than the end of the file's mission by more than `DOUBTFUL` may be wrong. The
# mission may end up to `AHEAD` after the clock: simulated time passes as fast as it is computed.
DOUBTFUL = timedelta(days=30)
AHEAD = timedelta(days=1)


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """Something about a departure that the operator should know; `code` is the code in the log."""

    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Departure:
    """What a mission needs to know before it begins.

    `state` (6,) is where the boat is expected, and `reached` the number of targets reached before.
    `started` is the UTC time of the first estimate. `clears` says whether to delete a recorded
    mission. `quantities` are those that the survey file declares, and `doubts` the warnings for the
    operator. `sortie` is the sortie that sets out, if the plan has sorties. `spent` is what the
    boat had used of its battery when it was last heard of.
    """

    survey: Survey
    vessel: Vessel
    state: State
    reached: int
    started: datetime
    clears: bool
    quantities: Quantities = LIMNOLOGICAL
    doubts: tuple[Doubt, ...] = ()
    sortie: Sortie | None = None
    spent: Consumption = NOTHING


def prepare(
    survey_file: SurveyFile,
    now: datetime,
    *,
    resume: bool = False,
    force: bool = False,
    sortie: int | None = None,
    renews: bool | None = None,
) -> Departure:
    """Return where the mission of a survey file sets out; nothing is changed yet.

    If the plan has sorties, one of them sets out: the one with the number `sortie`. Without a
    number it is the sortie sailed last if `resume` is set and it is unfinished, and otherwise the
    first unfinished one. A sortie that has not begun, or after which its boat sailed another,
    starts at its harbour.

    With `resume` the mission continues where and when the recorded track ends, and the targets
    reached stay reached. With `force` it begins anew. `renews` says whether a boat that came home
    before its sortie was done has a new battery (None: only a simulated boat has). Raises
    `PlanError` for a survey without targets, and `SurveyFileError` for one that has been run and is
    neither resumed nor forced.
    """
    survey = survey_file.survey
    if force:
        # The revisions of a mission are discarded with it.
        survey = survey_of(survey, as_planned(survey_file.revisions()))
    if survey.vessel is None or survey.start is None or not survey.targets:
        raise PlanError(f"{survey_file.path} has no targets to steer to; plan a survey first.")
    reached = survey_file.progress().reached
    ends = survey_file.track_ends()
    own: Sortie | None = None
    if sortie is not None or survey_file.revision.sorties:
        part = part_of(survey_file, sortie, resume=resume)
        own, goes_on = part.sortie, resume and part.is_under_way
        ends = survey_file.track_ends(own.boat)
        if part.reached > 0 or force:
            _refuse_to_repeat(part, resume=resume, force=force)
        if not goes_on and (resume or part.reached == 0):
            return _from_harbour(survey_file, now, part, ends)
        survey, reached = part.survey, part.reached
    vessel, start = survey.vessel, survey.start
    assert vessel is not None
    assert start is not None
    if ends and not (resume or force):
        raise _holds_a_mission(survey_file, reached, survey)
    state, started = start.at_rest(), now
    if ends and resume:
        state, started = ends[1].state, _after_all(survey_file, now, ends)
    return Departure(
        survey=survey,
        vessel=vessel,
        state=state,
        reached=reached if resume else 0,
        started=started,
        clears=ends is not None and not resume,
        quantities=survey_file.quantities,
        doubts=_doubts(survey_file, now, ends if resume else None),
        sortie=own,
        spent=_spent_before(survey_file, survey, own, renews) if ends and resume else NOTHING,
    )


def _holds_a_mission(survey_file: SurveyFile, reached: int, survey: Survey) -> SurveyFileError:
    return SurveyFileError(
        f"{survey_file.path} already holds a mission ({reached} of {len(survey.targets)} targets "
        "reached); resume it, or start again by force.",
        settings=("resume", "force"),
    )


def _after_all(survey_file: SurveyFile, now: datetime, ends: tuple[TrackEnd, TrackEnd]) -> datetime:
    """Return the time from which a mission continues. Simulated time may be ahead of the clock, and
    the last sample may be later than the last row of the track.
    """
    over = survey_file.last_time() or ends[1].time
    return max(now, over + timedelta(seconds=AFTER_S))


def _spent_before(
    survey_file: SurveyFile, survey: Survey, sortie: Sortie | None, renews: bool | None
) -> Consumption:
    """Return what a boat has spent of the battery with which it continues. It is not known whether
    a real boat whose part is unfinished got another battery at the harbour.
    """
    boat = 1 if sortie is None else sortie.boat
    if renews is None:
        renews = is_simulated(survey_file.meta().get("water", ""))
    home = renews and _came_home(survey_file, boat)
    return _spent(survey_file, survey, boat, came_home=home)


def _spent(survey_file: SurveyFile, survey: Survey, boat: int, *, came_home: bool) -> Consumption:
    assert survey.vessel is not None
    assert survey.start is not None
    tracks = survey_file.track().each_boat()
    track = next((one for one in tracks if int(one.boat[0]) == boat), None)
    harbour = (survey.start.north_m, survey.start.east_m)
    if track is None:
        return NOTHING
    return consumption_since_harbour(track, survey.vessel, harbour, came_home=came_home)


def _spent_by(survey_file: SurveyFile, survey: Survey, boat: int) -> Consumption:
    """Return what a boat has spent when it takes over another boat's part from where it is. This
    counts from its last time at one of its planned harbours: nobody changes its battery elsewhere.
    """
    planned = as_planned(survey_file.revisions()).sorties
    own = [one.start for one in planned if one.boat == boat]
    if survey.start in own:
        return NOTHING
    each = [_spent(survey_file, replace(survey, start=one), boat, came_home=False) for one in own]
    return min(each, key=lambda spent: spent.seconds, default=NOTHING)


def _came_home(survey_file: SurveyFile, boat: int) -> bool:
    """Whether the last mission of a boat ended as it should, where its battery may be changed."""
    whose = "" if survey_file.survey.fleet is None else f"boat {boat}: "
    own = [event for event in survey_file.events() if event.message.startswith(whose)]
    return bool(own) and own[-1].code in {end.value for end in AT_HOME}


def _refuse_to_repeat(part: Part, *, resume: bool, force: bool) -> None:
    """Refuse to sail a sortie again that has begun: it can only be resumed."""
    if force:
        raise UsageError(
            "A sortie cannot be started again, because that would delete the others; resume it, "
            "or plan the survey again.",
            settings=("force", "resume"),
        )
    if part.reached == len(part.survey.targets) and not resume:
        raise SurveyFileError(
            f"The sortie is complete: its {part.reached} targets are reached; choose another.",
            settings=("sortie",),
        )


@dataclass(frozen=True, kw_only=True)
class Part:
    """One sortie of a survey: a survey of its targets alone, how many of them are reached, and
    whether it is the sortie that its boat sailed last.
    """

    survey: Survey
    reached: int
    sortie: Sortie
    is_under_way: bool


def part_of(survey_file: SurveyFile, number: int | None, *, resume: bool = False) -> Part:
    """Return a sortie of a survey file by its number. Without a number, return the sortie sailed
    last if `resume` is set and it is unfinished, and otherwise the first unfinished one.
    """
    progress, revision = survey_file.progress(), survey_file.revision
    last = _sailed_last(survey_file)
    open_ = [one for one in revision.sorties if progress.reached_in(one) < len(one)]
    if number is not None:
        chosen = revision.sortie(number)
    elif resume and last is not None and last in open_:
        chosen = last
    else:
        chosen = (open_ or list(revision.sorties[-1:]))[0]
    return Part(
        survey=survey_of(survey_file.survey, revision, chosen),
        reached=progress.reached_in(chosen),
        sortie=chosen,
        is_under_way=_sailed_last(survey_file, chosen.boat) == chosen,
    )


def _sailed_last(survey_file: SurveyFile, boat: int | None = None) -> Sortie | None:
    """Return the sortie of the target that was steered to last, by one boat or by any."""
    seq, revision = survey_file.last_target(boat), survey_file.revision
    place = next((i for i, t in enumerate(revision.targets, 1) if t.seq == seq), 0)
    return next((one for one in revision.sorties if one.first <= place <= one.last), None)


def _from_harbour(
    survey_file: SurveyFile, now: datetime, part: Part, ends: tuple[TrackEnd, TrackEnd] | None
) -> Departure:
    """Set out from the harbour; times continue after everything that is recorded."""
    survey = part.survey
    vessel, start = survey.vessel, survey.start
    if vessel is None or start is None:
        raise PlanError(f"{survey_file.path} has no targets to steer to; plan a survey first.")
    over, state = survey_file.last_time(), start.at_rest()
    spent = NOTHING
    # A boat that takes over another's part sets out from where it is, with its battery as it is.
    if ends and math.dist(ends[1].state[:2], state[:2]) < SAME_PLACE_M:
        state = ends[1].state
        spent = _spent_by(survey_file, survey, part.sortie.boat)
    return Departure(
        survey=survey,
        vessel=vessel,
        state=state,
        reached=part.reached,
        started=now if over is None else max(now, over + timedelta(seconds=AFTER_S)),
        clears=False,
        quantities=survey_file.quantities,
        doubts=_doubts(survey_file, now, ends),
        sortie=part.sortie,
        spent=spent,
    )


def _doubts(
    survey_file: SurveyFile, now: datetime, ends: tuple[TrackEnd, TrackEnd] | None
) -> tuple[Doubt, ...]:
    """Return doubts about the computer's clock, and about the file's journal."""
    said = [_clock_doubt(now, survey_file.meta().get("created", ""), ends)]
    if ends and survey_file.journal_missing:
        said.append(
            Doubt(
                code="journal_missing",
                message=f"{survey_file.path} was not closed by the mission that wrote it, and "
                f"its journal {survey_file.path.name}-wal is missing; if the file was "
                "copied, copy the journal too, or what was recorded after "
                f"{_said(ends[1].time)} may be lost",
            )
        )
    return tuple(doubt for doubt in said if doubt)


def _clock_doubt(
    now: datetime, created: str, ends: tuple[TrackEnd, TrackEnd] | None
) -> Doubt | None:
    """Return a doubt if the clock disagrees with the times in the file."""
    clock = f"this computer's clock says {_said(now)}"
    if ends and (now < ends[0].time or ends[1].time - now > AHEAD):
        text = (
            f"{clock}, before the recorded mission ended ({_said(ends[1].time)}); new times "
            "continue from there; set the clock"
        )
        return Doubt(code="clock_doubtful", message=text)
    if ends and now - ends[1].time > DOUBTFUL:
        days = (now - ends[1].time).days
        text = (
            f"{clock}, {days} days after the recorded mission ended; if that is wrong, set the "
            "clock"
        )
        return Doubt(code="clock_doubtful", message=text)
    if not ends and created and now < parse_time(created):
        text = f"{clock}, before this plan was made ({created}); set the clock"
        return Doubt(code="clock_doubtful", message=text)
    return None


def _said(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
