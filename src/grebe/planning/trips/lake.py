"""A meshed lake with its harbours: the paths home, the costs of legs, and the limits of trips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.planning.paths.corridors import PathFinder
from grebe.planning.paths.harbour_distances import HarbourDistances, harbour_distances
from grebe.planning.paths.travel import Travel
from grebe.planning.planner import Draft, Planner
from grebe.planning.route.costs import Costs, costs_of
from grebe.planning.route.portfolio import Route
from grebe.planning.trips.endurance import HOME_SLACK_S, Endurance
from grebe.planning.trips.trip_times import Depots

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Number of nearby cells next to which a place for a cell is sought.
BESIDE = 12


@dataclass(frozen=True, kw_only=True)
class Lake:
    """A meshed lake with the paths to its harbours and the costs of its legs.

    `wanted` (n,) marks the cells that are to be visited.
    """

    planner: Planner
    draft: Draft
    finder: PathFinder
    homes: tuple[HarbourDistances, ...]
    costs: Costs
    wanted: NDArray[np.bool_]

    @property
    def travel(self) -> Travel:
        """What travelling costs the boat."""
        return self.planner.travel

    @property
    def pitch_s(self) -> float:
        """Time from a cell to the next, approximately [s]."""
        return self.draft.cell_m * float(np.mean(self.travel.slowness))

    def seconds(self, outwards: bool) -> NDArray[np.float64]:
        """Time of the paths from the harbours to the cells, or back, (h, n) [s]: their lengths at
        the slowness along the straight line.
        """
        sign = 1.0 if outwards else -1.0
        rows: list[NDArray[np.float64]] = []
        for home in self.homes:
            offsets = sign * (self.draft.network.centres - np.array(home.place))
            straight = np.maximum(np.hypot(*offsets.T), 1e-9)
            rows.append(home.distances_m * self.travel.leg_s(offsets) / straight)
        return np.array(rows)

    def part(self, order: NDArray[np.int64]) -> Lake:
        """Return the lake with only the cells of an order to visit; the others are plain water."""
        wanted = np.zeros(len(self.wanted), dtype=np.bool_)
        wanted[order] = True
        route = Route(order=order, legs_s=0.0, method=self.draft.route.method)
        return replace(self, draft=replace(self.draft, route=route), wanted=wanted)


def lake_for_boat(planner: Planner, lake: Lake, homes: tuple[HarbourDistances, ...]) -> Lake:
    """Return the lake for another boat: with that boat's costs of legs, and with its harbours."""
    costs = costs_of(lake.draft.network, planner.travel, homes[0].place, returns=True)
    return replace(lake, planner=planner, homes=homes, costs=costs)


def lake_of(planner: Planner, draft: Draft, places: Sequence[tuple[float, float]]) -> Lake:
    """Measure the paths from each place to the cells; each place is moved into its nearest cell."""
    cells, network = draft.cells, draft.network
    shapes = np.array([cell.footprint for cell in cells], dtype=object)
    homes: list[HarbourDistances] = []
    for place in places:
        point = shapely.Point(place)
        cell = int(np.argmin(shapely.distance(shapes, point)))
        inner = shapes[cell].buffer(-0.1)
        inside = inner if not inner.is_empty else shapely.centroid(shapes[cell])
        north, east = shapely.get_coordinates(shapely.shortest_line(inside, point))[0].tolist()
        homes.append(harbour_distances(network, planner.water, (north, east), cell))
    return Lake(
        planner=planner,
        draft=draft,
        finder=PathFinder(cells, network, planner.water, draft.cell_m),
        homes=tuple(homes),
        costs=costs_of(network, planner.travel, homes[0].place, returns=True),
        wanted=np.array([not cell.is_speck for cell in cells]),
    )


def depots_of(lake: Lake, endurance: Endurance, factor: float) -> Depots:
    """Collect the input of the exchange, for trips that take `factor` times their legs' time."""
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
    distances_m = np.array([home.distances_m for home in lake.homes])
    return Depots(
        out=lake.seconds(outwards=True),
        back=lake.seconds(outwards=False),
        home=endurance.home_s(distances_m) / factor,
        beside=beside,
        limit_s=(endurance.limit_s - HOME_SLACK_S) / factor,
        pitch_s=lake.pitch_s,
    )
