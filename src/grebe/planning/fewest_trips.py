"""The fewest trips that hold all cells of a lake, each within what a battery lasts.

The cells are put in the order in which a walk around the tree of shortest ways from the harbour
meets them, so that a stretch of that order is a wedge of the lake with its tip at the harbour.
Each wedge is made a round trip, and `grebe.planning.trips` then exchanges cells between them. The
fewest trips that hold all cells are taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import PlanError
from grebe.core.taut import taut_way
from grebe.planning.corridors import Waterways
from grebe.planning.costs import Costs, costs_of
from grebe.planning.endurance import HOME_SLACK_S, Endurance
from grebe.planning.planner import Draft, Planner
from grebe.planning.polish import polished
from grebe.planning.travel import WANDER, Travel
from grebe.planning.trips import Ports, comes_home, improved_trips, trip_s
from grebe.planning.ways_home import WaysHome, around_the_tree, ways_home

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# Rounds of the exchange between trips, for each cell and at most.
ROUNDS_EACH, MOST_ROUNDS = 100, 400_000
# The share of the rounds that tells whether a number of trips can hold all cells, and the share of
# the cells that may be left then.
TRIAL_SHARE, MOST_ABSENT_SHARE = 0.15, 0.01
# Kicks of the polish of one trip.
KICKS = 3_000
# Cells that are looked at when a cell looks for a place.
BESIDE = 12
MOST_SORTIES = 200
FITTINGS = 5


@dataclass(frozen=True, kw_only=True)
class Lake:
    """A meshed lake with the ways to its harbours, and what its legs cost."""

    planner: Planner
    draft: Draft
    ways: Waterways
    homes: tuple[WaysHome, ...]
    costs: Costs
    wanted: NDArray[np.bool_]

    @property
    def travel(self) -> Travel:
        """What ways cost the boat."""
        return self.planner.travel

    @property
    def pitch_s(self) -> float:
        """Time from a cell to the next, or so."""
        return self.draft.cell_m * float(np.mean(self.travel.slowness))

    def seconds(self, outwards: bool) -> NDArray[np.float64]:
        """Time of the ways from the harbours to the cells, or back, (h, n): as long as they are,
        by the direction from the one to the other.
        """
        sign = 1.0 if outwards else -1.0
        rows: list[NDArray[np.float64]] = []
        for home in self.homes:
            way = sign * (self.draft.network.centres - np.array(home.place))
            straight = np.maximum(np.hypot(*way.T), 1e-9)
            rows.append(home.ways_m * self.travel.leg_s(way) / straight)
        return np.array(rows)


@dataclass(frozen=True, kw_only=True)
class Trips:
    """Orders of cells, the harbour of each by its number, and what they take by their legs
    through the cells' centres [s]; `bound_s` is below what any trips take in that measure.
    """

    orders: tuple[Order, ...]
    harbours: NDArray[np.int64]
    legs_s: float
    bound_s: float
    limit_s: float


def lake_of(planner: Planner, draft: Draft, places: Sequence[tuple[float, float]]) -> Lake:
    """Measure the ways from each place to the cells; it is moved into the nearest cell."""
    cells, network = draft.cells, draft.network
    shapes = np.array([cell.footprint for cell in cells], dtype=object)
    homes: list[WaysHome] = []
    for place in places:
        point = shapely.Point(place)
        cell = int(np.argmin(shapely.distance(shapes, point)))
        inner = shapes[cell].buffer(-0.1)
        inside = inner if not inner.is_empty else shapely.centroid(shapes[cell])
        north, east = shapely.get_coordinates(shapely.shortest_line(inside, point))[0].tolist()
        homes.append(ways_home(network, planner.water, (north, east), cell))
    return Lake(
        planner=planner,
        draft=draft,
        ways=Waterways(cells, network, planner.water, draft.cell_m),
        homes=tuple(homes),
        costs=costs_of(network, planner.travel, homes[0].place, returns=True),
        wanted=np.array([not cell.is_speck for cell in cells]),
    )


def trips_within(lake: Lake, endurance: Endurance, rounds: int | None = None) -> Trips:
    """Return the fewest trips that hold all cells, each within the endurance as it is predicted
    to be sailed. `rounds` of the exchange between them (None: by the number of cells).
    """
    count = int(lake.wanted.sum())
    rounds = min(ROUNDS_EACH * count, MOST_ROUNDS) if rounds is None else rounds
    # How much longer a trip takes than its legs through the centres: turns, and corners cut.
    factor, trips, best = _first_factor(lake), None, None
    for _ in range(FITTINGS):
        ports = ports_of(lake, endurance, factor)
        _refuse_unreachable(lake, ports)
        trips = _fewest(lake, ports, rounds, trips)
        seconds = _predicted_s(lake, trips)
        longest = float(seconds.max()) / (endurance.limit_s - HOME_SLACK_S)
        if longest <= 1:
            best = trips if best is None or len(trips.orders) < len(best.orders) else best
            if len(best.orders) <= math.ceil(seconds.sum() / endurance.limit_s):
                return best
        elif best is not None:
            return best
        factor *= 1.005 * longest
    if best is None:
        raise PlanError("No sorties were found whose predicted times keep the limit: a fault.")
    return best


def _first_factor(lake: Lake) -> float:
    """What one way through all cells is predicted to take, over its legs through the centres."""
    order = lake.draft.route.order
    footprints = np.array([cell.footprint for cell in lake.draft.cells], dtype=object)[order]
    centres = lake.draft.network.centres[order]
    if len(order) < 2:
        return WANDER
    north, east = centres[0].tolist()
    legs_s = float(lake.travel.leg_s(np.diff(centres, axis=0)).sum())
    return lake.travel.path_s(taut_way((north, east), footprints)) / legs_s


def ports_of(lake: Lake, endurance: Endurance, factor: float) -> Ports:
    """Gather what the exchange reads, where a trip takes `factor` times its legs' time."""
    centres = lake.draft.network.centres
    members = np.flatnonzero(lake.wanted)
    many = min(BESIDE + 1, len(members))
    beside = np.full((len(centres), BESIDE), -1)
    if many > 1:
        from scipy.spatial import KDTree

        near = KDTree(centres[members]).query(centres[members], k=many)[1]
        beside[members, : many - 1] = members[np.asarray(near)[:, 1:]]
    else:
        beside[members, 0] = members
    ways_m = np.array([home.ways_m for home in lake.homes])
    return Ports(
        out=lake.seconds(outwards=True),
        back=lake.seconds(outwards=False),
        home=endurance.home_s(ways_m) / factor,
        beside=beside,
        limit_s=(endurance.limit_s - HOME_SLACK_S) / factor,
        pitch_s=lake.pitch_s,
    )


def bound_s(lake: Lake, ports: Ports, trips: int = 1) -> float:
    """Return what no such trips through the centres of all cells go below together [s].

    Each cell has a leg to it and one from it, no shorter than its two shortest; each trip has
    two at its harbour.
    """
    out, back = ports.out.min(axis=0), ports.back.min(axis=0)
    legs = np.column_stack([lake.costs.nearest_s[:, :2], np.minimum(out, back)])[lake.wanted]
    least = np.sort(legs, axis=1)[:, :2].sum()
    at_harbours = trips * (out[lake.wanted].min() + back[lake.wanted].min())
    return 0.5 * float(least + at_harbours)


def _refuse_unreachable(lake: Lake, ports: Ports) -> None:
    best = np.min(ports.out + np.maximum(ports.home, ports.back), axis=0)[lake.wanted]
    if best.max() > ports.limit_s:
        away = np.min([home.ways_m for home in lake.homes], axis=0)[lake.wanted].max()
        raise PlanError(
            f"The cell farthest from a harbour is {away:.0f} m away along the water, and no sortie "
            "comes home from there within its battery or its minutes; give more of them, or "
            "another harbour nearby.",
            settings=("sortie_battery_wh", "sortie_minutes", "harbours"),
        )


def _fewest(lake: Lake, ports: Ports, rounds: int, before: Trips | None) -> Trips:
    """The best trips of the smallest number that hold all cells."""
    fewest = math.ceil(bound_s(lake, ports) / ports.limit_s)
    for count in range(fewest, MOST_SORTIES + 1):
        known = before is not None and len(before.orders) == count
        if known and before is not None:
            orders, harbours = list(before.orders), before.harbours
        else:
            orders, harbours = _wedges(lake, ports, count)
        trimmed = [
            _trimmed(lake, ports, int(h), order) for h, order in zip(harbours, orders, strict=True)
        ]
        # A first, short exchange tells whether so many trips may do at all.
        tried = max(1, int(TRIAL_SHARE * rounds))
        found, absent = improved_trips(lake.costs, ports, trimmed, harbours, tried)
        if len(absent) > MOST_ABSENT_SHARE * lake.wanted.sum():
            continue
        found, absent = improved_trips(lake.costs, ports, found, harbours, rounds)
        if len(absent) == 0:
            kept = [i for i, order in enumerate(found) if len(order)]
            return _trips(lake, ports, [found[i] for i in kept], harbours[kept])
    raise PlanError(
        f"More than {MOST_SORTIES} sorties would be needed; give them more time or larger cells.",
        settings=("sortie_battery_wh", "sortie_minutes", "cell_m"),
    )


def _trips(lake: Lake, ports: Ports, orders: list[Order], harbours: NDArray[np.int64]) -> Trips:
    seconds = [
        trip_s(lake.costs, ports, int(h), order, len(order))
        for h, order in zip(harbours, orders, strict=True)
    ]
    return Trips(
        orders=tuple(orders),
        harbours=harbours,
        legs_s=float(sum(seconds)),
        bound_s=bound_s(lake, ports, len(orders)),
        limit_s=ports.limit_s,
    )


def _wedges(lake: Lake, ports: Ports, count: int) -> tuple[list[Order], NDArray[np.int64]]:
    """So many trips: wedges of the water around each harbour, of equal numbers of cells."""
    nearest = np.argmin(ports.out, axis=0)
    members = [lake.wanted & (nearest == h) for h in range(len(lake.homes))]
    sizes = np.array([one.sum() for one in members])
    orders: list[Order] = []
    harbours: list[int] = []
    for h, parts in enumerate(_shared(sizes, count)):
        walk = around_the_tree(lake.draft.network, lake.homes[h], members[h])
        costs = costs_of(lake.draft.network, lake.travel, lake.homes[h].place, returns=True)
        for part in np.array_split(np.array(walk, dtype=np.int64), parts) if parts else []:
            orders.append(polished(costs, part, KICKS)[0] if len(part) > 1 else part)
            harbours.append(h)
    return orders, np.array(harbours, dtype=np.int64)


def _shared(sizes: NDArray[np.int64], count: int) -> list[int]:
    """Share `count` trips out by the numbers of cells, the largest remainders first."""
    exact = count * sizes / sizes.sum()
    parts = np.floor(exact).astype(int)
    for h in np.argsort(parts - exact)[: count - parts.sum()]:
        parts[h] += 1
    return parts.tolist()


def _trimmed(lake: Lake, ports: Ports, harbour: int, order: Order) -> Order:
    """The longest beginning of an order that is a trip within the limit."""
    low, high = 0, len(order)
    while low < high:
        middle = (low + high + 1) // 2
        if comes_home(lake.costs, ports, harbour, order, middle):
            low = middle
        else:
            high = middle - 1
    return order[:low].copy()


def _predicted_s(lake: Lake, trips: Trips) -> NDArray[np.float64]:
    """What each trip is predicted to take [s]."""
    found: list[float] = []
    for harbour, order in zip(trips.harbours.tolist(), trips.orders, strict=True):
        footprints = [stop.footprint for stop in lake.ways.stops(order)]
        way = taut_way(lake.homes[harbour].place, footprints)
        home_m = float(lake.homes[harbour].ways_m[order[-1]])
        back_s = WANDER * home_m * float(np.mean(lake.travel.slowness))
        found.append(lake.travel.path_s(way) + back_s)
    return np.array(found)
