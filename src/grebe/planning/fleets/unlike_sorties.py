"""Sorties of unlike boats: each has a part of the lake, and trips within its own battery.

The cells are first shared out, as stretches of one good order. Which boat takes which stretch, and
how long the stretch is, depends on the time of the boat's trips through it: a boat with a small
battery goes out and home more often, so it gets fewer cells, and near ones. Then each boat's trips
are found within its own stretch. If they take longer than estimated, the boat gets less.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import PlanError
from grebe.core.plan_settings import FleetSettings, check_speed
from grebe.core.survey import Survey
from grebe.core.taut import taut_path
from grebe.planning.fleets.stretches import check_cells, shared_evenly
from grebe.planning.merge import checked, merged
from grebe.planning.planned import PlannedSorties
from grebe.planning.planner import Draft, Planner
from grebe.planning.trips.endurance import HOME_SLACK_S, Endurance, endurance_of
from grebe.planning.trips.fewest_trips import Trips, check_reach, trips_within
from grebe.planning.trips.lake import Lake, lake_for_boat, lake_of
from grebe.planning.trips.trip_surveys import trip_surveys

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

Heard = Callable[[int, int], None] | None

# The least share of a trip that counts as left for its cells, even if the path there takes all of
# it. A stretch from which a boat cannot get home thus counts as 1 / LEAST_LEFT times as long.
LEAST_LEFT = 0.02
# How often the lake is shared out at most, and the ratio of the longest time to the mean at which
# that ends.
SHARINGS, EVEN = 4, 1.04


def share_sorties(
    planner: Planner,
    draft: Draft,
    places: Sequence[tuple[float, float]],
    notes: tuple[str, ...] = (),
    on_done: Heard = None,
    rounds: int | None = None,
) -> PlannedSorties:
    """Plan sorties for a fleet of unlike boats. Raises `PlanError` with the reason when there is no
    plan.

    `places` are the harbours, which all boats may use; without them each boat sets out from its own
    start, or all from the draft's. `on_done` is called with the progress of the search. `rounds` is
    the length of the search (None: by the number of cells).
    """
    fleet = planner.settings.fleet
    assert fleet is not None
    check_cells(len(draft.route.order), fleet.boats)
    bound_m = planner.bound_m(draft)
    shares = _evened(_boats_of(planner, draft, places, fleet, rounds), draft, bound_m, on_done)
    parts = [part for one in shares for part in one.parts]
    whose = [one.boat.number for one in shares for _ in one.parts]
    survey, revision = merged(parts, bound_m, whose)
    assert survey.outcome is not None
    return PlannedSorties(
        survey=survey, outcome=survey.outcome, check=checked(survey, revision, planner.water),
        notes=notes, revision=revision, bound_s=sum(one.trips.bound_s for one in shares),
        legs_s=sum(one.trips.legs_s for one in shares),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Boat:
    """One boat of a fleet: the lake with this boat's costs of legs, its endurance, and the rounds
    of a search for its trips.
    """

    number: int
    lake: Lake
    endurance: Endurance
    rounds: int | None = None

    def takes_s(self, stretch: Order) -> float:
        """Approximate time of the trips through a stretch [s]: the farther the cells of a trip are
        from its harbour, the less time is left for them.
        """
        out = self.lake.seconds(outwards=True)[:, stretch]
        back = self.lake.seconds(outwards=False)[:, stretch]
        distances_m = np.array([home.distances_m[stretch] for home in self.lake.homes])
        limit_s = self.endurance.limit_s - HOME_SLACK_S
        farthest_s = np.min(
            out + np.maximum(back, self.endurance.home_s(distances_m)), axis=0
        ).max()
        left = 1.0 - float(np.min(out + back, axis=0).mean()) / limit_s
        if farthest_s > limit_s:
            left = LEAST_LEFT
        return self._through_s(stretch) / max(left, LEAST_LEFT)

    def _through_s(self, stretch: Order) -> float:
        """Time of the taut path through a stretch [s]."""
        north, east = self.lake.draft.network.centres[stretch[0]].tolist()
        footprints = [self.lake.draft.cells[i].footprint for i in stretch.tolist()]
        return self.lake.travel.path_s(taut_path((north, east), footprints))

    def check_reach(self, stretch: Order) -> None:
        """Raise `PlanError` if a cell of the stretch is too far for any trip."""
        with self.named():
            check_reach(self.lake.part(stretch), self.endurance)

    def share(self, stretch: Order, bound_m: float, on_done: Heard) -> _Share:
        """Find the fewest trips within the stretch, and make their surveys."""
        with self.named():
            trips = trips_within(self.lake.part(stretch), self.endurance, self.rounds, on_done)
        parts = trip_surveys(self.lake, trips, bound_m)
        return _Share(boat=self, stretch=stretch, trips=trips, parts=parts)

    @contextmanager
    def named(self) -> Generator[None]:
        """Put the boat's number and name in front of the message of a `PlanError`."""
        try:
            yield
        except PlanError as error:
            text = str(error)
            raise PlanError(
                f"Boat {self.number}, {self.lake.planner.vessel.name}: {text[0].lower()}{text[1:]}",
                settings=error.settings,
            ) from None


def _boats_of(
    planner: Planner,
    draft: Draft,
    places: Sequence[tuple[float, float]],
    fleet: FleetSettings,
    rounds: int | None,
) -> list[_Boat]:
    """The boats of a fleet, each with its vessel, its battery and its harbours."""
    region, settings = planner.region, planner.settings
    starts = [region.frame.place_near(region.water, one, "start") for one in fleet.starts]
    lake = lake_of(planner, draft, places or starts or [draft.start])
    boats: list[_Boat] = []
    for number in range(1, fleet.boats + 1):
        vessel = fleet.vessel(number) or planner.vessel
        check_speed(settings, vessel)
        own = replace(planner, vessel=vessel)
        homes = lake.homes if places or not starts else lake.homes[number - 1 : number]
        power_w = own.mean_power_w(draft)
        boats.append(
            _Boat(
                number=number,
                lake=lake_for_boat(own, lake, homes),
                endurance=endurance_of(vessel, settings.of_boat(number), power_w),
                rounds=rounds,
            )
        )
    return boats


@dataclass(frozen=True, kw_only=True)
class _Share:
    """One boat's share of the lake: a stretch of the order, its trips there, and their surveys."""

    boat: _Boat
    stretch: Order
    trips: Trips
    parts: list[Survey]

    @property
    def time_s(self) -> float:
        """Total predicted time of the trips [s]."""
        return sum(part.outcome.time_s for part in self.parts if part.outcome is not None)


def _evened(boats: Sequence[_Boat], draft: Draft, bound_m: float, on_done: Heard) -> list[_Share]:
    """The shares with the smallest maximum time that was found, in the order of the boats.

    The time of a stretch is estimated before its trips are known. When the lake is shared out
    again, the estimate is corrected by its ratio to the time of the trips that were found.
    """
    longer = dict.fromkeys((boat.number for boat in boats), 1.0)
    whose: list[_Boat] = []
    best: tuple[float, list[_Share]] | None = None
    for sharing in range(SHARINGS):
        try:
            shared = _shared(boats, draft, longer, whose)
            # Checked first, so that no search is wasted because another boat cannot have trips.
            for boat, stretch in shared:
                boat.check_reach(stretch)
            heard = [
                _heard(on_done, sharing * len(boats) + k, SHARINGS * len(boats))
                for k in range(len(boats))
            ]
            shares = [
                boat.share(stretch, bound_m, hears)
                for (boat, stretch), hears in zip(shared, heard, strict=True)
            ]
        except PlanError:
            # The shares found before are valid, even if this sharing out is not.
            if best is None:
                raise
            break
        times = np.array([one.time_s for one in shares])
        if best is None or times.max() < best[0]:
            best = float(times.max()), shares
        if times.max() < EVEN * times.mean():
            break
        for one in shares:
            longer[one.boat.number] = one.time_s / one.boat.takes_s(one.stretch)
    assert best is not None
    return best[1]


def _heard(on_done: Heard, before: int, searches: int) -> Heard:
    """The callback of one search, which reports its progress as that of several equal searches."""
    if on_done is None:
        return None
    return lambda done, most: on_done(before * most + done, searches * most)


def _shared(
    boats: Sequence[_Boat], draft: Draft, longer: Mapping[int, float], whose: list[_Boat]
) -> list[tuple[_Boat, Order]]:
    """Each boat with its stretch of the order, in the order of the boats.

    All stretches have about the same estimated time, corrected by the boat's factor in `longer`.
    `whose` is the boat of each stretch; it is filled by the first call and kept by later ones.
    """
    order = draft.route.order
    legs = boats[0].lake.travel.leg_s(np.diff(draft.network.centres[order], axis=0))

    def parts_of(stretches: Sequence[Order]) -> tuple[list[tuple[_Boat, Order]], list[float]]:
        # The size of a stretch is fitted to its boat, so the assignment is kept.
        if not whose:
            whose[:] = _assigned(boats, stretches)
        parts = list(zip(whose, stretches, strict=True))
        return parts, [longer[boat.number] * boat.takes_s(stretch) for boat, stretch in parts]

    # Every leg takes some time, so that cells at the same place are not divided arbitrarily.
    legs_s = np.concatenate([[0.0], legs]) + 1e-3 * float(np.mean(legs))
    found = shared_evenly(order, legs_s, len(boats), parts_of)
    return sorted(found, key=lambda part: part[0].number)


def _assigned(boats: Sequence[_Boat], stretches: Sequence[Order]) -> list[_Boat]:
    """The boat of each stretch, by the assignment with the least total time."""
    # Imported here, so that plans for one boat, which are most, need not wait for it.
    from scipy.optimize import linear_sum_assignment

    takes_s = np.array([[boat.takes_s(stretch) for stretch in stretches] for boat in boats])
    rows, taken = linear_sum_assignment(takes_s)
    of = dict(zip(taken.tolist(), rows.tolist(), strict=True))
    return [boats[of[k]] for k in range(len(stretches))]
