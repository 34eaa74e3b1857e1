"""Revisions of a plan: an order of the targets, cut into sorties, and the reason for it.

Targets are never edited in place, and a target's number is never reused. Only the order changes: a
revision lists the targets to visit, their order, their corridors and the sorties. A pure function
makes a new revision from an old one, and a survey file stores them all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal, get_args

import shapely

from grebe.core.errors import InputError, UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Pose, Survey, Target

# Reasons for an order, as listed: first plan; cells shared out among boats; other weather; progress
# slower or faster than predicted; area closed; target out of reach; boat lost; uncertain places of
# the map; boat that resumes from elsewhere.
Reason = Literal[
    "planned", "shared", "weather", "progress", "closed", "unreachable", "boat_lost", "adaptive",
    "resumed",
]  # fmt: skip
REASONS: tuple[Reason, ...] = get_args(Reason)


@dataclass(frozen=True, kw_only=True)
class Sortie:
    """One trip of one boat: the targets at places `first` to `last` of its revision's order.

    Places are counted from 1, both ends included. The boat is launched at `start` and returns
    there. `time_s` and `energy_wh` are predictions that include the trips out and home.
    """

    number: int
    first: int
    last: int
    start: Pose
    time_s: float
    energy_wh: float
    boat: int = 1

    def __post_init__(self) -> None:
        if min(self.number, self.boat) < 1 or not 1 <= self.first <= self.last:
            raise InputError(
                f"Sortie {self.number} of boat {self.boat} holds places {self.first} to "
                f"{self.last}; sorties, boats and places are counted from 1, first to last."
            )
        if not (0 <= self.time_s < math.inf and 0 <= self.energy_wh < math.inf):
            raise InputError(f"Sortie {self.number} has no finite time and energy.")

    def __len__(self) -> int:
        return self.last - self.first + 1


@dataclass(frozen=True, kw_only=True)
class PlanRevision:
    """One order of a survey's targets; `number` counts from 1.

    `corridors` are empty or as many as the targets. `sorties` are empty for a single mission, or
    follow each other without a gap. `highest_seq` is the highest number given to any target of the
    survey so far, in any revision. `note` is a sentence for people. `settings` apply from this
    order on, since a later one may be for other boats or another battery than the first; None for
    a survey that was not planned.
    """

    number: int
    reason: Reason
    targets: tuple[Target, ...]
    corridors: tuple[shapely.Polygon, ...] = ()
    sorties: tuple[Sortie, ...] = ()
    highest_seq: int = 0
    note: str = ""
    made_at: datetime | None = None
    settings: PlanSettings | None = None

    def __post_init__(self) -> None:
        if self.reason not in REASONS:
            raise InputError(f"{self.reason!r} is not a reason for a revision of a plan.")
        if self.corridors and len(self.corridors) != len(self.targets):
            raise InputError("The revision has corridors for some of its targets, but not for all.")
        if self.highest_seq < max((target.seq for target in self.targets), default=0):
            raise InputError("The revision holds targets beyond the highest number given so far.")
        _check_sorties(self.sorties, len(self.targets))

    def sortie(self, number: int) -> Sortie:
        """Return a sortie by its number; raises `UsageError` if there is none."""
        for one in self.sorties:
            if one.number == number:
                return one
        there = f"it has {len(self.sorties)}" if self.sorties else "it is a single mission"
        raise UsageError(f"The plan has no sortie {number}; {there}.", settings=("sortie",))


def _check_sorties(sorties: Sequence[Sortie], places: int) -> None:
    following = 1
    for one in sorties:
        if one.first != following:
            raise InputError(f"Sortie {one.number} begins at place {one.first}, not {following}.")
        following = one.last + 1
    if sorties and following != places + 1:
        raise InputError(f"The sorties hold {following - 1} of {places} targets.")
    numbers = [one.number for one in sorties]
    if len(set(numbers)) != len(numbers):
        raise InputError("Two sorties have the same number.")


def first_revision(
    survey: Survey, sorties: Sequence[Sortie] = (), made_at: datetime | None = None
) -> PlanRevision:
    """Return the order that a survey was planned with."""
    return PlanRevision(
        number=1,
        reason="planned",
        targets=survey.targets,
        corridors=survey.corridors,
        sorties=tuple(sorties),
        highest_seq=max((target.seq for target in survey.targets), default=0),
        made_at=made_at,
        settings=survey.settings,
    )


def revised(
    old: PlanRevision,
    *,
    reason: Reason,
    note: str,
    targets: Sequence[Target],
    corridors: Sequence[shapely.Polygon] = (),
    sorties: Sequence[Sortie] = (),
    made_at: datetime | None = None,
    settings: PlanSettings | None = None,
) -> PlanRevision:
    """Return the revision that follows another; `settings` default to those of the old one.

    A target with the number of an old one must be that target; new ones are numbered from
    `old.highest_seq + 1` on (`numbered_on`). Raises `InputError` otherwise.
    """
    known = {target.seq: target for target in old.targets}
    for target in targets:
        before = known.get(target.seq)
        if before is not None and before.set != target.set:
            raise InputError(
                f"Target {target.seq} of the new order differs from target {target.seq} of the "
                "old one."
            )
    return PlanRevision(
        number=old.number + 1,
        reason=reason,
        note=note,
        targets=tuple(targets),
        corridors=tuple(corridors),
        sorties=tuple(sorties),
        highest_seq=max(old.highest_seq, *(target.seq for target in targets)),
        made_at=made_at,
        settings=settings or old.settings,
    )


def as_planned(revisions: Sequence[PlanRevision]) -> PlanRevision:
    """Return the last revision that no mission has made, which a fresh start sails."""
    return next(one for one in reversed(revisions) if one.reason in ("planned", "shared"))


def begun_anew(revisions: Sequence[PlanRevision]) -> PlanRevision | None:
    """Return the revision that restores the planned order; None if it is the current one."""
    last, planned = revisions[-1], as_planned(revisions)
    if last.number == planned.number:
        return None
    return revised(
        last,
        reason=planned.reason,
        note=f"started again in the order of revision {planned.number}",
        targets=planned.targets,
        corridors=planned.corridors,
        sorties=planned.sorties,
        settings=planned.settings,
    )


def numbered_on(old: PlanRevision, new: Sequence[Target]) -> tuple[Target, ...]:
    """Return new targets, numbered on from the highest number given so far."""
    return tuple(replace(target, seq=old.highest_seq + i) for i, target in enumerate(new, 1))


def left_out(old: PlanRevision, new: PlanRevision) -> tuple[int, ...]:
    """Return the numbers of the cells that the old order visits and the new one does not."""
    kept = {target.seq for target in new.targets}
    return tuple(t.seq for t in old.targets if t.kind == "cell" and t.seq not in kept)


def survey_of(survey: Survey, revision: PlanRevision, sortie: Sortie | None = None) -> Survey:
    """Return a survey in the order of a revision, all of it or one sortie.

    With a sortie, the survey has the vessel, the battery and the minutes of its boat.
    """
    survey = replace(survey, settings=revision.settings or survey.settings)
    if sortie is None:
        return replace(survey, targets=revision.targets, corridors=revision.corridors)
    places = slice(sortie.first - 1, sortie.last)
    return replace(
        survey,
        vessel=survey.vessel_of(sortie.boat),
        settings=survey.settings and survey.settings.of_boat(sortie.boat),
        targets=revision.targets[places],
        corridors=revision.corridors[places],
        start=sortie.start,
    )
