"""From where a mission sets out: at the plan's start, or where a recorded one was cut off.

Times are those of the clock when a mission sets out, and from there on the link's own, so that no
step of the clock disturbs them. Only here can a wrong clock be met: it is said, and the times
of one file never run back.
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
from grebe.mission.spent import AT_HOME, NOTHING, Spent, spent_since_harbour

# A mission that goes on begins this long after all that is recorded, at the earliest.
AFTER_S = 0.1
# A boat so near to where it is to set out lies there already, with its own heading [m].
SAME_PLACE_M = 1.0
# A clock that differs by more from what the file says may be wrong. A recorded mission may end
# some hours ahead of the clock: simulated time passes as fast as it is computed.
DOUBTFUL = timedelta(days=30)
AHEAD = timedelta(days=1)


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """Something about a departure that the operator should know; `code` as in the log."""

    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Departure:
    """What a mission needs to know before it begins.

    `state` (6,) where the boat is expected, `reached` the number of targets reached before,
    `started` the UTC time of its first estimate, `clears` whether a recorded mission is to be
    forgotten; `quantities` those that the survey file declares; `doubts` what is to be said;
    `sortie` which one sets out, of a plan in sorties; `spent` what the boat's battery had given
    when it was last heard of.
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
    spent: Spent = NOTHING


def prepare(
    survey_file: SurveyFile,
    now: datetime,
    *,
    resume: bool = False,
    force: bool = False,
    sortie: int | None = None,
    renews: bool | None = None,
) -> Departure:
    """Return from where the mission of a survey file sets out; nothing is changed yet.

    Of a plan in sorties it is one that sets out, by its number; without one that which was sailed
    last, to `resume` it, or else the first that is not done. One that has not been begun, or after
    which another was sailed, sets out from its harbour.

    With `resume` it goes on where and when the recorded track ends, and what was reached stays
    reached; with `force` it begins anew. `renews`: a boat that came home before its sortie was done
    has another battery since (None: where it was a simulated one). Raises `PlanError` for a survey
    without targets and `SurveyFileError` for one that has been run and is neither resumed nor
    forced.
    """
    survey = survey_file.survey
    if force:
        # What a mission revised goes with that mission.
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
        f"{survey_file.path} holds a mission already ({reached} of {len(survey.targets)} "
        "targets reached); resume it, or begin anew by force.",
        settings=("resume", "force"),
    )


def _after_all(survey_file: SurveyFile, now: datetime, ends: tuple[TrackEnd, TrackEnd]) -> datetime:
    """The time from which a mission goes on: simulated time runs ahead of the clock, and the last
    sample may be younger than the last row of its track.
    """
    over = survey_file.last_time() or ends[1].time
    return max(now, over + timedelta(seconds=AFTER_S))


def _spent_before(
    survey_file: SurveyFile, survey: Survey, sortie: Sortie | None, renews: bool | None
) -> Spent:
    """What a boat has spent of the battery that it goes on with: of a real one nobody knows that it
    was changed at the harbour, where what it had set out for is not done.
    """
    boat = 1 if sortie is None else sortie.boat
    if renews is None:
        renews = is_simulated(survey_file.meta().get("water", ""))
    home = renews and _came_home(survey_file, boat)
    return _spent(survey_file, survey, boat, came_home=home)


def _spent(survey_file: SurveyFile, survey: Survey, boat: int, *, came_home: bool) -> Spent:
    assert survey.vessel is not None
    assert survey.start is not None
    tracks = survey_file.track().each_boat()
    track = next((one for one in tracks if int(one.boat[0]) == boat), None)
    harbour = (survey.start.north_m, survey.start.east_m)
    if track is None:
        return NOTHING
    return spent_since_harbour(track, survey.vessel, harbour, came_home=came_home)


def _spent_by(survey_file: SurveyFile, survey: Survey, boat: int) -> Spent:
    """What a boat has spent that takes over another's part from where it lies, wherever that is:
    since it was last at a harbour of its own, as planned. Nobody has changed its battery there.
    """
    planned = as_planned(survey_file.revisions()).sorties
    own = [one.start for one in planned if one.boat == boat]
    if survey.start in own:
        return NOTHING
    each = [_spent(survey_file, replace(survey, start=one), boat, came_home=False) for one in own]
    return min(each, key=lambda spent: spent.seconds, default=NOTHING)


def _came_home(survey_file: SurveyFile, boat: int) -> bool:
    """Whether the last mission of a boat ended as it should, where a battery may be changed."""
    whose = "" if survey_file.survey.fleet is None else f"boat {boat}: "
    own = [event for event in survey_file.events() if event.message.startswith(whose)]
    return bool(own) and own[-1].code in {end.value for end in AT_HOME}


def _refuse_to_repeat(part: Part, *, resume: bool, force: bool) -> None:
    """A sortie that has been begun is gone on with, and not sailed again."""
    if force:
        raise UsageError(
            "A sortie is not begun anew, for that would forget the others; plan the survey "
            "anew, or go on with the sortie.",
            settings=("force", "resume"),
        )
    if part.reached == len(part.survey.targets) and not resume:
        raise SurveyFileError(
            f"The sortie is sailed: its {part.reached} targets are reached; go on with another.",
            settings=("sortie",),
        )


@dataclass(frozen=True, kw_only=True)
class Part:
    """One sortie of a survey: its targets alone, how many of them are reached, and whether no other
    of its boat was sailed since it was begun.
    """

    survey: Survey
    reached: int
    sortie: Sortie
    is_under_way: bool


def part_of(survey_file: SurveyFile, number: int | None, *, resume: bool = False) -> Part:
    """Return a sortie of a survey file by its number; without one that which was sailed last, to
    `resume` it, or else the first that is not done.
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
    """The sortie with the target that was steered to last, by a boat or by any."""
    seq, revision = survey_file.last_target(boat), survey_file.revision
    place = next((i for i, t in enumerate(revision.targets, 1) if t.seq == seq), 0)
    return next((one for one in revision.sorties if one.first <= place <= one.last), None)


def _from_harbour(
    survey_file: SurveyFile, now: datetime, part: Part, ends: tuple[TrackEnd, TrackEnd] | None
) -> Departure:
    """Set out from the harbour; times go on after all that is recorded."""
    survey = part.survey
    vessel, start = survey.vessel, survey.start
    if vessel is None or start is None:
        raise PlanError(f"{survey_file.path} has no targets to steer to; plan a survey first.")
    over, state = survey_file.last_time(), start.at_rest()
    spent = NOTHING
    # Who takes over what another has left sets out from where it lies, with what it has left.
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
    """What does not fit: the clock to the file, or the file to its journal."""
    said = [_clock_doubt(now, survey_file.meta().get("created", ""), ends)]
    if ends and survey_file.journal_missing:
        said.append(
            Doubt(
                code="journal_missing",
                message=f"{survey_file.path} was not closed by the mission that wrote it, and its "
                f"journal {survey_file.path.name}-wal is not beside it; where the file was copied, "
                f"copy that too, or what is in it after {_said(ends[1].time)} may be missing",
            )
        )
    return tuple(doubt for doubt in said if doubt)


def _clock_doubt(
    now: datetime, created: str, ends: tuple[TrackEnd, TrackEnd] | None
) -> Doubt | None:
    """Whether the clock can be right, by what the file holds."""
    clock = f"this computer's clock says {_said(now)}"
    if ends and (now < ends[0].time or ends[1].time - now > AHEAD):
        text = f"{clock}, before the recorded mission ended ({_said(ends[1].time)}); times go on "
        return Doubt(code="clock_doubtful", message=text + "from there; set the clock")
    if ends and now - ends[1].time > DOUBTFUL:
        days = (now - ends[1].time).days
        text = f"{clock}, {days} days after the recorded mission ended; if that is not so, set it"
        return Doubt(code="clock_doubtful", message=text)
    if not ends and created and now < parse_time(created):
        text = f"{clock}, before this plan was made ({created}); set the clock"
        return Doubt(code="clock_doubtful", message=text)
    return None


def _said(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
