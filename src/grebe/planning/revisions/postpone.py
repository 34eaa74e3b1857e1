"""Put off the cells for which a slow sortie has no time: a pure function, like all of replanning.

Predictions are corrected by the pace so far: a boat that takes a quarter longer than predicted for
half of its sortie is expected to take a quarter longer for the rest. If that does not fit, the last
cells of the order become a sortie of their own, from the same harbour. The last cells are chosen
because the path home from them is a part of both sorties, so cells near the harbour cost least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from grebe.core.counts import counted
from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision, Sortie, survey_of
from grebe.core.survey import Survey, Target
from grebe.core.vessel import Vessel
from grebe.planning.revisions.revise import (
    Halfway,
    OpenWater,
    path_through_cells,
    put_in_order,
    remaining_s,
)
from grebe.planning.trips.endurance import MARGIN

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True, kw_only=True)
class Delay:
    """A late sortie: it takes `pace` times as long as predicted, has sailed for `elapsed_s`, and
    must be back in `left_s`.
    """

    pace: float
    elapsed_s: float
    left_s: float


def postponed(
    old: PlanRevision,
    survey: Survey,
    open_: OpenWater,
    halfway: Halfway,
    delay: Delay,
    *,
    vessel: Vessel,
    weather: Weather,
) -> PlanRevision:
    """Return the revision in which the last cells of a sortie become a sortie of their own.

    Raises `PlanError` when all cells fit after all, when none does, and for a plan without sorties.
    """
    if halfway.sortie is None:
        raise PlanError("The plan is a single mission: there is no later sortie to move cells to.")
    part = survey_of(survey, old, halfway.sortie)
    ahead = [t for t in part.targets[halfway.reached :] if t.seq in open_.place_of]
    fits = _that_fit(survey, part.targets[-1], ahead, halfway, delay, vessel, weather)
    if not 0 < fits < len(ahead):
        raise PlanError(f"{fits} of {len(ahead)} targets fit, so none is moved.")
    now, later = ([open_.place_of[t.seq] for t in some] for some in (ahead[:fits], ahead[fits:]))
    number = max(one.number for one in old.sorties) + 1
    shorter = put_in_order(
        old, survey, open_, halfway, now, vessel=vessel, weather=weather, reason="progress",
        note=f"the sortie takes {delay.pace:.2f} times as long as predicted: "
            f"{counted(len(later), 'target is', 'targets are')} moved to sortie {number}",
    )  # fmt: skip
    own = shorter.sortie(halfway.sortie.number)
    targets, corridors = _later(shorter, survey, open_, own, later, vessel, weather)

    def takes_s(place: tuple[float, float], stops: Sequence[Target]) -> float:
        return delay.pace * remaining_s(survey, place, stops, weather, vessel)

    rest = shorter.targets[own.first - 1 + halfway.reached : own.last]
    at_sea_s = delay.elapsed_s + takes_s(halfway.place, rest)
    again_s = takes_s((own.start.north_m, own.start.east_m), targets)
    return _with_one_more(shorter, own, number, targets, corridors, (at_sea_s, again_s))


def _that_fit(
    survey: Survey, end: Target, ahead: Sequence[Target], halfway: Halfway, delay: Delay,
    vessel: Vessel, weather: Weather,
) -> int:  # fmt: skip
    """How many of the cells ahead leave time for the path home."""

    def fits(count: int) -> bool:
        stops = [*ahead[:count], end]
        takes_s = remaining_s(survey, halfway.place, stops, weather, vessel)
        return MARGIN * delay.pace * takes_s <= delay.left_s

    low, high = 0, len(ahead)
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if fits(middle) else (low, middle - 1)
    return low


def _later(
    plan: PlanRevision, survey: Survey, open_: OpenWater, own: Sortie, cells: Sequence[int],
    vessel: Vessel, weather: Weather,
) -> tuple[list[Target], list[shapely.Polygon]]:  # fmt: skip
    """The targets and corridors of the cells that are put off, from the harbour and back to it."""
    start = (own.start.north_m, own.start.east_m)
    halfway = Halfway(reached=0, place=start, sortie=own)
    end = plan.targets[own.last - 1]
    targets, corridors = path_through_cells(
        plan, survey, open_, halfway, cells, end, vessel=vessel, weather=weather
    )
    highest = max(plan.highest_seq, *(target.seq for target in targets))
    return [*targets[:-1], replace(end, seq=highest + 1)], corridors


def _with_one_more(
    plan: PlanRevision, own: Sortie, number: int, targets: Sequence[Target],
    corridors: Sequence[shapely.Polygon], times_s: tuple[float, float],
) -> PlanRevision:  # fmt: skip
    """The plan with one more sortie; `times_s` predicts the times of `own` and of the new one."""
    first, power = len(plan.targets) + 1, own.energy_wh / max(own.time_s, 1e-9)
    shortened, later = (replace(own, time_s=time_s, energy_wh=power * time_s) for time_s in times_s)
    later = replace(later, number=number, first=first, last=first + len(targets) - 1)
    sorties = [shortened if one.number == own.number else one for one in plan.sorties]
    return replace(
        plan,
        targets=(*plan.targets, *targets),
        corridors=(*plan.corridors, *corridors),
        sorties=(*sorties, later),
        highest_seq=max(plan.highest_seq, *(target.seq for target in targets)),
    )
