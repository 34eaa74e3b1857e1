"""Find the fewest trips that hold all cells of a lake, each within what a battery lasts.

`grebe.planning.trips.wedges` makes the first trips, and `grebe.planning.trips.trips` exchanges
cells between them. Then the shortest trip is dissolved into the others, again and again, until
they cannot take its cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import PlanError
from grebe.core.taut import taut_path
from grebe.planning.paths.travel import WANDER
from grebe.planning.trips.endurance import HOME_SLACK_S, Endurance
from grebe.planning.trips.lake import Lake, depots_of
from grebe.planning.trips.repaired_trips import predicted_trip_s, repaired
from grebe.planning.trips.trip_times import Depots, shortest_stretch, trip_s
from grebe.planning.trips.trips import HOT, WARM, improved_trips
from grebe.planning.trips.wedges import wedges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Rounds of the exchange between trips: for each cell, at least and at most in all, and at least for
# each cell when only a share of them is used.
ROUNDS_EACH, LEAST_ROUNDS, MOST_ROUNDS, LEAST_EACH = 250, 200_000, 1_500_000, 5
# The share of the rounds that shows whether a number of trips can hold all cells, and the share of
# the cells that may be left over then.
TRIAL_SHARE, MOST_ABSENT_SHARE = 0.15, 0.03
# The share of the rounds for trips that are nearly good.
WARM_SHARE = 0.15
# All exchanges together usually take this many times the rounds of one.
EXPECTED = 2.5
# One trip fewer is tried if the others would be at most this full: the ratio of trips' times to
# their legs' varies by some per cent. With at most `SMALL_ROUNDS`, for a small lake, the search for
# them is a complete one.
FULLEST, SMALL_ROUNDS = 1.1, 400_000
MOST_SORTIES = 200
FITTINGS = 10


@dataclass(frozen=True, kw_only=True)
class Trips:
    """Orders of cells, and the number of the harbour of each.

    `legs_s` is the total time of their legs through the cells' centres, `bound_s` a lower bound of
    that time for any trips, and `limit_s` the limit of each trip.
    """

    orders: tuple[Order, ...]
    harbours: NDArray[np.int64]
    legs_s: float
    bound_s: float
    limit_s: float


def trips_within(
    lake: Lake,
    endurance: Endurance,
    rounds: int | None = None,
    on_done: Callable[[int, int], None] | None = None,
) -> Trips:
    """Return the fewest trips that hold all cells, each predicted to keep within the endurance.

    `rounds` is the length of an exchange between trips (None: by the number of cells). `on_done` is
    called with the rounds done and the expected total. Raises `PlanError` when there are no such
    trips.
    """
    count = int(lake.wanted.sum())
    if rounds is None:
        rounds = min(max(ROUNDS_EACH * count, LEAST_ROUNDS), MOST_ROUNDS)
    effort = _Effort(rounds, on_done)
    factor, trips, best = _factor(lake, endurance, effort), None, None
    for _ in range(FITTINGS):
        search = _Search(lake, depots_of(lake, endurance, factor), rounds, effort)
        trips = search.fewer(search.first() if trips is None else search.fitted(trips))
        trips = search.repaired(trips, endurance.limit_s - HOME_SLACK_S)
        seconds = _predicted_s(lake, trips)
        longest = float(seconds.max()) / (endurance.limit_s - HOME_SLACK_S)
        if longest <= 1:
            if best is not None and len(trips.orders) >= len(best.orders):
                return best
            best = trips
            if seconds.sum() > FULLEST * (len(best.orders) - 1) * endurance.limit_s:
                return best
        factor *= 1.005 * longest
    if best is None:
        raise PlanError(
            "No sorties were found whose predicted times keep the limit, although each cell "
            "alone is within reach; allow a little more time or battery, or choose other cells.",
            settings=("sortie_battery_wh", "sortie_minutes", "cell_m"),
        )
    return best


def check_reach(lake: Lake, endurance: Endurance) -> None:
    """Raise `PlanError` if a cell is too far from every harbour for any trip. This is known before
    the search for trips.
    """
    _refuse_unreachable(lake, depots_of(lake, endurance, _first_factor(lake)))


class _Effort:
    """The progress of the search in rounds."""

    def __init__(self, rounds: int, on_done: Callable[[int, int], None] | None) -> None:
        self.rounds, self._on_done = rounds, on_done
        self._done = 0

    def spend(self, rounds: int) -> None:
        """Count rounds that were done, and report the progress."""
        self._done += rounds
        if self._on_done is not None:
            most = max(EXPECTED * self.rounds, self._done + WARM_SHARE * self.rounds)
            self._on_done(self._done, int(most))


def _factor(lake: Lake, endurance: Endurance, effort: _Effort) -> float:
    """The ratio of trips' times to those of their legs through the centres, due to turns and cut
    corners, estimated from trips after a short exchange.
    """
    depots = depots_of(lake, endurance, _first_factor(lake))
    trips = _Search(lake, depots, int(TRIAL_SHARE * effort.rounds), effort).first()
    return float(_predicted_s(lake, trips).sum()) / max(trips.legs_s, lake.pitch_s)


def _first_factor(lake: Lake) -> float:
    """The ratio of the predicted time of one path through all cells to that of its legs."""
    order = lake.draft.route.order
    footprints = np.array([cell.footprint for cell in lake.draft.cells], dtype=object)[order]
    centres = lake.draft.network.centres[order]
    if len(order) < 2:
        return WANDER
    north, east = centres[0].tolist()
    legs_s = float(lake.travel.leg_s(np.diff(centres, axis=0)).sum())
    return lake.travel.path_s(taut_path((north, east), footprints)) / legs_s


def bound_s(lake: Lake, depots: Depots, trips: int = 1) -> float:
    """Return a lower bound [s] of the total time of trips through the centres of all cells.

    Each cell has a leg to it and one from it, no shorter than its two shortest legs; each trip has
    two legs at its harbour.
    """
    out, back = depots.out.min(axis=0), depots.back.min(axis=0)
    legs = np.column_stack([lake.costs.nearest_s[:, :2], np.minimum(out, back)])[lake.wanted]
    least = np.sort(legs, axis=1)[:, :2].sum()
    at_harbours = trips * (out[lake.wanted].min() + back[lake.wanted].min())
    return 0.5 * float(least + at_harbours)


def _refuse_unreachable(lake: Lake, depots: Depots) -> None:
    best = np.min(depots.out + np.maximum(depots.home, depots.back), axis=0)[lake.wanted]
    if best.max() > depots.limit_s:
        away = np.min([home.distances_m for home in lake.homes], axis=0)[lake.wanted].max()
        raise PlanError(
            f"The cell farthest from a harbour is {away:.0f} m away along the water, and no "
            "sortie gets there and back within its battery or minutes; give about "
            f"{math.ceil(10.5 * best.max() / depots.limit_s) / 10:.1f} times as much, or another "
            "harbour nearby.",
            settings=("sortie_battery_wh", "sortie_minutes", "harbours"),
        )


@dataclass(frozen=True)
class _Search:
    """The search for the fewest trips within one limit."""

    lake: Lake
    depots: Depots
    rounds: int
    effort: _Effort

    @property
    def _again(self) -> tuple[float, float]:
        """Share of the rounds, and first temperature, for trips that are nearly good."""
        return (1.0, HOT) if self.rounds <= SMALL_ROUNDS else (WARM_SHARE, WARM)

    def first(self) -> Trips:
        """Return trips that hold all cells, as few as a short exchange finds to be enough."""
        _refuse_unreachable(self.lake, self.depots)
        count = math.ceil(bound_s(self.lake, self.depots) / self.depots.limit_s)
        while count <= MOST_SORTIES:
            orders, harbours = wedges(self.lake, self.depots, count)
            orders = _all_trimmed(self.lake, self.depots, harbours, orders)
            absent = self._exchanged(orders, harbours, TRIAL_SHARE, HOT)[1]
            if len(absent) <= MOST_ABSENT_SHARE * self.lake.wanted.sum():
                return self._with_all(orders, harbours, 1.0, HOT)
            count += max(1, int(0.5 * len(absent) * self.depots.pitch_s / self.depots.limit_s))
        raise _too_many()

    def fitted(self, trips: Trips) -> Trips:
        """Return trips of another limit, made to fit this one."""
        _refuse_unreachable(self.lake, self.depots)
        orders = _all_trimmed(self.lake, self.depots, trips.harbours, trips.orders)
        return self._with_all(orders, trips.harbours, *self._again)

    def fewer(self, trips: Trips) -> Trips:
        """Dissolve the shortest trip for as long as the others can take its cells."""
        while trips.legs_s <= FULLEST * self.depots.limit_s * (len(trips.orders) - 1):
            shortest = int(np.argmin(self._seconds(trips.orders, trips.harbours)))
            orders = [order for i, order in enumerate(trips.orders) if i != shortest]
            harbours = np.delete(trips.harbours, shortest)
            found, absent = self._exchanged(orders, harbours, *self._again)
            if len(absent):
                break
            trips = self._trips(found, harbours)
        return trips

    def repaired(self, trips: Trips, limit_s: float) -> Trips:
        """Return the trips with cells moved so that each is predicted to keep a limit, or unchanged
        if that fails.
        """
        orders = repaired(self.lake, self.depots, trips.orders, trips.harbours, limit_s)
        return trips if orders is None else self._trips(orders, trips.harbours)

    def _with_all(
        self, orders: list[Order], harbours: NDArray[np.int64], share: float, hot: float
    ) -> Trips:
        """Exchange cells, and add as many trips as it takes to hold all."""
        while len(orders) <= MOST_SORTIES:
            orders, absent = self._exchanged(orders, harbours, share, hot)
            if not len(absent):
                return self._trips(orders, harbours)
            nearest = np.argmin(self.depots.out[:, absent], axis=0)
            harbours = np.append(harbours, np.bincount(nearest).argmax())
            orders = [*orders, np.zeros(0, dtype=np.int64)]
            share, hot = self._again
        raise _too_many()

    def _exchanged(
        self, orders: list[Order], harbours: NDArray[np.int64], share: float, hot: float
    ) -> tuple[list[Order], Order]:
        rounds = max(LEAST_EACH * int(self.lake.wanted.sum()), int(share * self.rounds))
        found = improved_trips(self.lake.costs, self.depots, orders, harbours, rounds, hot)
        self.effort.spend(rounds)
        return found

    def _seconds(self, orders: Sequence[Order], harbours: NDArray[np.int64]) -> list[float]:
        return [
            trip_s(self.lake.costs, self.depots, int(h), order, len(order))
            for h, order in zip(harbours, orders, strict=True)
        ]

    def _trips(self, orders: list[Order], harbours: NDArray[np.int64]) -> Trips:
        kept = [i for i, order in enumerate(orders) if len(order)]
        orders, harbours = [orders[i] for i in kept], harbours[kept]
        return Trips(
            orders=tuple(orders),
            harbours=harbours,
            legs_s=float(sum(self._seconds(orders, harbours))),
            bound_s=bound_s(self.lake, self.depots, len(orders)),
            limit_s=self.depots.limit_s,
        )


def _too_many() -> PlanError:
    return PlanError(
        f"More than {MOST_SORTIES} sorties would be needed; give them more time or larger cells.",
        settings=("sortie_battery_wh", "sortie_minutes", "cell_m"),
    )


def _all_trimmed(
    lake: Lake, depots: Depots, harbours: NDArray[np.int64], orders: Sequence[Order]
) -> list[Order]:
    """Trips without the shortest stretch whose removal brings each within the limit."""
    kept: list[Order] = []
    for h, order in zip(harbours, orders, strict=True):
        first, last = shortest_stretch(lake.costs, depots, int(h), order)
        kept.append(np.concatenate([order[:first], order[last:]]))
    return kept


def _predicted_s(lake: Lake, trips: Trips) -> NDArray[np.float64]:
    """The predicted time of each trip [s]."""
    pairs = zip(trips.harbours.tolist(), trips.orders, strict=True)
    return np.array([predicted_trip_s(lake, harbour, order) for harbour, order in pairs])
