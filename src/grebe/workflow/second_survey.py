"""Plan a second survey, of one boat or several, from the measurements of a first one.

The places where readings pay most are chosen as for one boat that goes on, along one path as long
as all boats together may sail. They are then shared out and cut into sorties as any plan is. The
length of the path is fitted until the longest boat's time keeps its limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError, PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.core.revision import PlanRevision, survey_of
from grebe.core.samples import Samples
from grebe.core.sets import rings_of
from grebe.core.survey import Survey
from grebe.core.taut import path_through
from grebe.planning.cells.mesh import target_footprint
from grebe.planning.fleets.fleet_times import boat_times
from grebe.planning.fleets.shares import shared_out
from grebe.planning.merge import checked, merged
from grebe.planning.paths.connected_mesh import connected_mesh
from grebe.planning.paths.corridors import PathFinder
from grebe.planning.paths.network import Network
from grebe.planning.paths.place_paths import PlacePaths, place_paths
from grebe.planning.planned import PlannedSorties
from grebe.planning.planner import Draft, Planner
from grebe.planning.region import Region, water_of
from grebe.planning.revisions.adapt import Worth, chosen_places, once_read
from grebe.planning.revisions.second import followed_by
from grebe.planning.route.costs import costs_of
from grebe.planning.route.polish import polished
from grebe.planning.route.portfolio import Route
from grebe.planning.sortie_check import check_sorties
from grebe.planning.sorties import sorties_through
from grebe.planning.trips.endurance import endurance_of
from grebe.planning.trips.lake import lake_of
from grebe.workflow.adaptive import (
    CORE,
    FULL,
    PLACES,
    cores_of,
    weighted_sd,
    worth_of,
)
from grebe.workflow.wish import Wish

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.core.quantities import Quantities
    from grebe.planning.cells.mesh import Cell

    Array = NDArray[np.floating]
    Order = NDArray[np.int64]

Place = tuple[float, float]
# Kicks of the polish of the path that is shared out; rounds of the search for trips, which is
# repeated for each length of the path that is tried: per place, and at least.
KICKS, ROUNDS_EACH, LEAST_ROUNDS = 2_000, 250, 20_000
# A place is visited if the way there and home takes up to this share of a sortie: one at the very
# end of its range would take a sortie for itself.
REACH_SHARE = 0.8
# How many lengths of the path are tried; the share of the time that the next one aims at; and the
# share to which a path that was too long is shortened at least.
TRIALS, AIM, SHRINKS = 7, 0.5 * (1 + FULL), 0.8


@dataclass(frozen=True, kw_only=True)
class SecondSurvey:
    """The revision of a second survey, its plan by itself, and the accuracy before and after.

    `before_sd` and `expected_sd` are the root mean square of the map's standard deviation before
    and as expected after, weighted by importance.
    """

    revision: PlanRevision
    planned: PlannedSorties
    before_sd: float
    expected_sd: float
    places: int


def second_survey(
    survey: Survey,
    revision: PlanRevision,
    samples: Samples,
    quantities: Quantities,
    wish: Wish,
    settings: PlanSettings,
    lies: Sequence[Place] = (),
    on_done: Callable[[int, int], None] | None = None,
) -> SecondSurvey:
    """Return the survey that follows one that was sailed, based on what it measured.

    `settings` give the boats, batteries and harbours; each boat sails for the wish's minutes at
    most. `lies` (north, east) are the places where boats without a harbour set out, one for each
    boat; without any, each is launched where its part begins. `on_done` is called with the progress
    of the search.

    Raises `InputError` if the measurements yield no map, and `PlanError` if the time is too short
    for any place, or if an independent check does not prove the plan.
    """
    if wish.quantity not in samples.values:
        raise InputError(f"The survey has no quantity {wish.quantity!r}.")
    water = _Water.of(survey, settings, lies)
    worth = worth_of(survey, samples, quantities, water.places, wish, water.pass_s)
    route, planned = _fitted(water, worth, wish, on_done)
    _prove(planned, water.planner)
    boats = 1 if settings.fleet is None else settings.fleet.boats
    longest_s = max(one.under_way_s for one in boat_times(planned.revision))
    whose = f", shared out among {boats} boats" if boats > 1 else ""
    new = followed_by(
        revision, survey, planned.revision, settings=settings,
        note=f"{len(route)} more places for {wish.text}{whose}, in {longest_s / 60:.1f} minutes",
    )  # fmt: skip
    then = once_read(worth, water.paths, _paths_of(planned))
    before, after = (weighted_sd(np.diag(w.covariance), worth.weights) for w in (worth, then))
    return SecondSurvey(
        revision=new, planned=planned, before_sd=before, expected_sd=after, places=len(route)
    )


@dataclass(frozen=True, kw_only=True)
class _Water:
    """Places all over the water, the planner of paths through them, and where boats set out."""

    planner: Planner
    cells: list[Cell]
    network: Network
    members: Order
    lies: Sequence[Place]
    harbours: Sequence[Place]
    start: Place

    @classmethod
    def of(cls, survey: Survey, settings: PlanSettings, lies: Sequence[Place]) -> _Water:
        """Mesh the water of a survey; cells too narrow to be hit are only passed through."""
        if survey.vessel is None or survey.start is None:
            raise PlanError("Only a planned survey can be followed by another; plan it first.")
        region = Region(name=survey.name, frame=survey.frame, water=survey.water)
        water = water_of(survey)
        cell_m = math.sqrt(water.area / PLACES)
        places = replace(
            settings, cell_m=cell_m, minutes=None, energy_wh=None, core=CORE, shape="square",
            pattern="free", angle_deg=0.0,
        )  # fmt: skip
        planner = Planner(region, survey.vessel, places, survey.no_go, water, None)
        given = () if settings.sorties is None else settings.sorties.harbours
        harbours = [region.frame.place_near(region.water, one, "harbour") for one in given]
        start = (survey.start.north_m, survey.start.east_m)
        near = [*harbours, *lies, start][0]
        cells, network = connected_mesh(water, cell_m, shape="square", angle_deg=0.0, near=near)
        rings = [target_footprint(ring) for ring in rings_of([one.footprint for one in cells])]
        wide = cores_of(rings, cell_m)[1] & np.array([not one.is_speck for one in cells])
        if not wide.any():
            raise PlanError("The water is nowhere wide enough for more places.")
        found = cls(
            planner=planner, cells=cells, network=network,
            members=np.flatnonzero(wide), lies=lies, harbours=harbours, start=start,
        )  # fmt: skip
        return found if settings.sorties is None else found.within_reach()

    def within_reach(self) -> _Water:
        """Return the water with only those places from which some boat comes home."""
        planner, settings = self.planner, self.planner.settings
        draft = self._draft(self.members)
        fleet = settings.fleet
        starts = [] if fleet is None or self.harbours else list(fleet.starts)
        region = planner.region
        own = [region.frame.place_near(region.water, one, "start") for one in starts]
        lake = lake_of(planner, draft, [*self.harbours, *own] or [self.start])
        out, back = lake.seconds(outwards=True), lake.seconds(outwards=False)
        distances_m = np.array([home.distances_m for home in lake.homes])
        near = np.zeros(len(self.cells), dtype=np.bool_)
        for boat in range(1, 1 + (1 if fleet is None else fleet.boats)):
            vessel = (fleet and fleet.vessel(boat)) or planner.vessel
            power_w = replace(planner, vessel=vessel).mean_power_w(draft)
            endurance = endurance_of(vessel, settings.of_boat(boat), power_w)
            takes_s = np.min(out + np.maximum(back, endurance.home_s(distances_m)), axis=0)
            near |= takes_s <= REACH_SHARE * endurance.limit_s
        members = self.members[near[self.members]]
        if not len(members):
            raise PlanError(
                "No boat can reach a place and get home within its battery or minutes; give more.",
                settings=("sortie_battery_wh", "sortie_minutes", "harbours"),
            )
        return replace(self, members=members)

    @property
    def cell_m(self) -> float:
        """The distance from a place to the next [m]."""
        assert self.planner.settings.cell_m is not None
        return self.planner.settings.cell_m

    @property
    def places(self) -> Array:
        """The places that can be visited (m, 2)."""
        return self.network.centres[self.members]

    @property
    def pass_s(self) -> float:
        """The time that passing a place takes [s]."""
        return self.cell_m * float(np.mean(self.planner.travel.slowness))

    @cached_property
    def paths(self) -> PlacePaths:
        """The paths between the places."""
        return place_paths(self.places, self.cell_m, self.planner.water)

    @property
    def begins(self) -> Place:
        """Where the one path that is shared out begins."""
        return [*self.harbours, *self.lies, self.start][0]

    def _draft(self, order: Order) -> Draft:
        """Return the mesh with an order of some cells."""
        return Draft(
            cells=self.cells, network=self.network, start=self.begins, cell_m=self.cell_m,
            angle_deg=0.0, route=Route(order=order, legs_s=0.0, method="adaptive"),
        )  # fmt: skip

    def planned(
        self, route: Sequence[int], on_done: Callable[[int, int], None] | None
    ) -> PlannedSorties:
        """Plan the survey of some places, by their numbers."""
        planner, settings = self.planner, self.planner.settings
        order = self.members[np.array(route)]
        if len(order) > 1:
            costs = costs_of(self.network, planner.travel, self.begins, returns=False)
            order = polished(costs, order, KICKS)[0]
        draft = self._draft(order)
        if settings.sorties is None and settings.fleet is None:
            return _alone(planner, draft)
        if settings.sorties is None:
            return shared_out(planner, draft, self.lies)
        rounds = max(LEAST_ROUNDS, ROUNDS_EACH * len(order))
        return sorties_through(planner, draft, self.harbours, on_done=on_done, rounds=rounds)


def _fitted(
    water: _Water, worth: Worth, wish: Wish, on_done: Callable[[int, int], None] | None
) -> tuple[list[int], PlannedSorties]:
    """Return the places that reduce the weighted variance most in the time, and their plan.

    Raises `PlanError` if there is none.
    """
    travel, fleet = water.planner.travel, water.planner.settings.fleet
    pace = 1 / float(np.mean(travel.slowness))
    turn_m = travel.turn_s_per_rad * pace
    nearest = int(np.argmin(np.hypot(*(water.places - np.array(water.begins)).T)))
    most_s = 60 * wish.minutes
    allowed_s = most_s * (1 if fleet is None else fleet.boats)
    best: tuple[list[int], PlannedSorties] | None = None
    tried: list[tuple[float, float]] = []
    for trial in range(TRIALS):
        route, _ = chosen_places(worth, water.paths, nearest, allowed_s, pace, turn_m)
        if not route:
            break
        planned = water.planned(route, _heard(on_done, trial))
        takes_s = max(one.under_way_s for one in boat_times(planned.revision))
        if takes_s <= most_s and (best is None or len(route) >= len(best[0])):
            best = route, planned
        if FULL * most_s <= takes_s <= most_s:
            break
        tried.append((takes_s, allowed_s))
        allowed_s = _next_s(tried, AIM * most_s)
    if best is None:
        raise PlanError(
            f"No place worth a reading is within {wish.minutes:g} minutes; give more.",
            settings=("minutes",),
        )
    return best


def _next_s(tried: Sequence[tuple[float, float]], aim_s: float) -> float:
    """Return how long the one path may be next [s].

    `tried` holds pairs: what the longest boat took, and what was allowed. The boats' times rise in
    steps, a sortie at a time. So a path that was too long is shortened by a fifth at least, and
    between two lengths the next is near the middle.
    """
    shorter = max((one for one in tried if one[0] <= aim_s), default=None, key=lambda one: one[1])
    longer = min((one for one in tried if one[0] > aim_s), default=None, key=lambda one: one[1])
    takes_s, allowed_s = tried[-1]
    if longer is None:
        return allowed_s * aim_s / takes_s
    if shorter is None:
        return allowed_s * min(aim_s / takes_s, SHRINKS)
    share = (aim_s - shorter[0]) / (longer[0] - shorter[0])
    return shorter[1] + (longer[1] - shorter[1]) * min(max(share, 0.3), 0.7)


def _alone(planner: Planner, draft: Draft) -> PlannedSorties:
    """Return the plan of one boat that does not come back, as one sortie."""
    finder = PathFinder(draft.cells, draft.network, planner.water, draft.cell_m)
    part = planner.survey(draft, finder, 0.0)
    survey, revision = merged([part], 0.0)
    outcome = survey.outcome
    assert outcome is not None
    return PlannedSorties(
        survey=survey, outcome=outcome, check=checked(survey, revision, planner.water),
        revision=revision, bound_s=outcome.time_s, legs_s=outcome.time_s,
    )  # fmt: skip


def _heard(
    on_done: Callable[[int, int], None] | None, trial: int
) -> Callable[[int, int], None] | None:
    """Return a callback for one search of several that take equally long."""
    if on_done is None:
        return None
    return lambda done, most: on_done(trial * most + done, TRIALS * most)


def _prove(planned: PlannedSorties, planner: Planner) -> None:
    """Refuse a plan that is not proved by checks that share nothing with the planner."""
    if not planned.check.outside_m2 == 0.0:
        raise PlanError("The paths between the places are not all within the water.")
    if planner.settings.sorties is None:
        return
    checks = check_sorties(planned.survey, planned.revision, planner.water)
    failed = [str(one.number) for one in checks if not one.holds]
    if failed:
        raise PlanError(
            f"It is not proved that boats get home in time from sortie {' and '.join(failed)}; "
            "allow a little more time or battery."
        )


def _paths_of(planned: PlannedSorties) -> list[Array]:
    """Return the shortest (taut) path (k, 2) of each sortie."""
    parts = [survey_of(planned.survey, planned.revision, one) for one in planned.revision.sorties]
    return [path_through(part) for part in parts]
