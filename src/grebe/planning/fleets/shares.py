"""Share a survey out among boats: each takes a stretch of one good order, all of about equal time.

A stretch of a short order contains cells that are close together, so each boat has its own part of
the lake and boats seldom meet. The ends of the stretches are moved until the predicted times,
including the paths from the starts, are alike. The assignment with the shortest paths out decides
which boat takes which stretch, and from which end. Boats may be of several kinds: each part is
planned for the boat that takes it, and a faster boat takes more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanSettings, check_speed
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.planning.fleets.stretches import check_cells, shared_evenly
from grebe.planning.merge import checked, merged
from grebe.planning.paths.corridors import PathFinder
from grebe.planning.planned import PlannedSorties
from grebe.planning.planner import Draft, Planner, planner_of
from grebe.planning.region import Region
from grebe.planning.route.portfolio import Route
from grebe.planning.trips.lake import lake_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]
    Array = NDArray[np.float64]


def plan_fleet(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    no_go: Sequence[shapely.Polygon] = (),
) -> PlannedSorties:
    """Plan a survey that several boats share, one trip each.

    Raises `PlanError` with the reason when there is no plan.
    """
    fleet = settings.fleet
    if fleet is None:
        raise UsageError(
            "The number of boats that share the survey is not given.", settings=("boats",)
        )
    first = fleet.starts[0] if fleet.starts else None
    planner, notes = planner_of(region, vessel, settings, first, no_go)
    places = [region.frame.place_near(region.water, one, "start") for one in fleet.starts]
    return shared_out(planner, planner.first_draft(quick=False), places, notes)


def shared_out(
    planner: Planner,
    draft: Draft,
    places: Sequence[tuple[float, float]],
    notes: tuple[str, ...] = (),
) -> PlannedSorties:
    """Plan the cells of a draft's order for the boats of the planner's fleet, one trip each.

    `places` (north, east) are their starts, one for each boat; without them each boat is launched
    where its part begins. Raises `PlanError` when there are fewer cells than boats.
    """
    settings, fleet = planner.settings, planner.settings.fleet
    assert fleet is not None
    check_cells(len(draft.route.order), fleet.boats)
    for one in fleet.vessels:
        check_speed(settings, one)
    vessels = [fleet.vessel(i + 1) or planner.vessel for i in range(fleet.boats)]
    planners = [replace(planner, vessel=one) for one in vessels]
    sharing = _Sharing.of(planners if fleet.vessels else [planner], draft, places, fleet.boats)
    parts, boats = sharing.balanced()
    bound_m = planner.bound_m(draft)
    survey, revision = merged(parts, bound_m, boats)
    alone_s = [_time_s(one.survey(draft, sharing.finder, bound_m)) for one in sharing.planners]
    assert survey.outcome is not None
    return PlannedSorties(
        survey=survey,
        outcome=survey.outcome,
        check=checked(survey, revision, planner.water),
        notes=notes,
        revision=revision,
        bound_s=alone_s[0] / fleet.boats
        if len(alone_s) == 1
        else 1.0 / sum(1.0 / each for each in alone_s),
        legs_s=max(one.time_s for one in revision.sorties),
    )


@dataclass(frozen=True, kw_only=True)
class _Sharing:
    """The order that is shared out.

    `planners`: one for each boat, or one for all; `legs_s` (n,): the times of the order's legs;
    `out_s` (boats, n): the times of the paths from the starts to each cell of the order, zero
    without starts.
    """

    planners: Sequence[Planner]
    draft: Draft
    finder: PathFinder
    places: Sequence[tuple[float, float]]
    legs_s: Array
    out_s: Array

    @classmethod
    def of(
        cls,
        planners: Sequence[Planner],
        draft: Draft,
        places: Sequence[tuple[float, float]],
        boats: int,
    ) -> _Sharing:
        planner = planners[0]
        lake = lake_of(planner, draft, places or [draft.start])
        order = draft.route.order
        centres = draft.network.centres[order]
        legs = planner.travel.leg_s(np.diff(centres, axis=0))
        out = lake.seconds(outwards=True)[:, order] if places else np.zeros((boats, len(order)))
        return cls(
            planners=planners, draft=draft, finder=lake.finder, places=places,
            legs_s=np.concatenate([[0.0], legs]) + float(np.mean(legs)) * 1e-3, out_s=out,
        )  # fmt: skip

    def balanced(self) -> tuple[list[Survey], list[int]]:
        """Return the parts with the smallest maximum time that was found, and the boat of each."""
        chosen: list[tuple[int, bool]] = []

        def parts_of(stretches: Sequence[Order]) -> tuple[list[tuple[Survey, int]], list[float]]:
            # The size of a stretch is fitted to its boat, so unlike boats keep their stretches.
            if not chosen or len(self.planners) == 1:
                chosen[:] = self._assigned(stretches)
            parts = [
                self._part(stretch, *one) for stretch, one in zip(stretches, chosen, strict=True)
            ]
            boats = [boat + 1 for boat, _ in chosen]
            return list(zip(parts, boats, strict=True)), [_time_s(part) for part in parts]

        found = shared_evenly(self.draft.route.order, self.legs_s, len(self.out_s), parts_of)
        return [part for part, _ in found], [boat for _, boat in found]

    def _assigned(self, stretches: Sequence[Order]) -> list[tuple[int, bool]]:
        """Which boat takes each stretch, and whether from its far end."""
        # Imported here, so that plans for one boat, which are most, need not wait for it.
        from scipy.optimize import linear_sum_assignment

        lengths = np.array([len(one) for one in stretches], dtype=np.int64)
        ends = np.cumsum(lengths)
        near, far = self.out_s[:, ends - lengths], self.out_s[:, ends - 1]
        boats, taken = linear_sum_assignment(np.minimum(near, far))
        of = dict(zip(taken.tolist(), boats.tolist(), strict=True))
        return [(of[k], bool(far[of[k], k] < near[of[k], k])) for k in range(len(stretches))]

    def _part(self, stretch: Order, boat: int, backwards: bool) -> Survey:
        order = stretch[::-1] if backwards else stretch
        place = self.places[boat] if self.places else None
        if place is None:
            north, east = self.draft.network.centres[order[0]].tolist()
            place = (north, east)
        draft = replace(
            self.draft,
            route=Route(order=order, legs_s=0.0, method=self.draft.route.method),
            start=place,
        )
        planner = self.planners[boat] if len(self.planners) > 1 else self.planners[0]
        return planner.survey(draft, self.finder, 0.0)


def _time_s(part: Survey) -> float:
    assert part.outcome is not None
    return part.outcome.time_s
