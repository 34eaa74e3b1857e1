"""The path home: the shortest path through the water from wherever the boat is to one place.

Home does not move, so the distance home from each corner of the shore is computed once (a
visibility graph, Lozano-Perez and Wesley 1979). From then on, the path from any place needs only
the best corner in sight. The path keeps a clearance from the shore where the water allows it. It
becomes transit targets with corridors, so the controller that sails a survey can sail it too.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from grebe.core.errors import PlanError
from grebe.core.sets import TargetSet, hull_of, ring_vertices
from grebe.core.survey import Pose, Survey, Target
from grebe.planning.paths.corridors import corridors_between
from grebe.planning.paths.reflex_vertices import reflex_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Places = NDArray[np.float64]

# Clearances from the shore, the first where there is room, the others where there is less [m].
CLEARANCES_M = (1.0, 0.5, 0.25, 0.1)
# The shore is simplified by these shares of the clearance until it has few enough corners.
COARSENESS = (0.3, 1.0, 3.0, 10.0)
MOST_CORNERS = 300
# Radius of home and of a waypoint, as a share of the clearance: a boat that cuts a corner by this
# much still keeps off the shore.
WAYPOINT_SHARE = 0.9
# How far the corridor of a leg may reach to either side [m].
CORRIDOR_REACH_M = 5.0
# Radius of the footprint around the boat from which a path begins [m].
START_RADIUS_M = 0.05
SLIVER_M = 1e-6


@dataclass(frozen=True, kw_only=True)
class RoutesHome:
    """Paths home within some water.

    `water` is the local polygon in which the boat may be; `home` (north, east) is in it. `room` is
    where paths may lead: the water less `clearance_m` at the shore.
    """

    water: shapely.Polygon
    home: tuple[float, float]
    room: shapely.Polygon
    clearance_m: float

    def path_from(self, place: tuple[float, float]) -> Places:
        """Return the shortest path from a place, (n, 2), with home as its last row. Raises
        `PlanError` when no water leads there.
        """
        begin = _into(self.room, place)
        legs = [np.array([place])] + ([np.array([begin])] if begin != place else [])
        last = [np.array([self.home])] if self._harbour != self.home else []
        if self._sees(begin, self._nodes[:1])[0]:
            return np.vstack([*legs, [self._harbour], *last])
        seen = self._sees(begin, self._nodes)
        away = np.hypot(*(self._nodes - begin).T) + self._lengths
        best = int(np.argmin(np.where(seen, away, np.inf)))
        if not seen[best] or not np.isfinite(away[best]):
            raise PlanError(
                f"No water leads home from {place[0]:.1f} m north, {place[1]:.1f} m east."
            )
        chain = [best]
        while chain[-1] != 0:
            chain.append(int(self._onwards[chain[-1]]))
        return np.vstack([*legs, self._nodes[chain], *last])

    @cached_property
    def _harbour(self) -> tuple[float, float]:
        """Home, or the place in the room that is nearest to it."""
        return _into(self.room, self.home)

    @cached_property
    def _nodes(self) -> Places:
        """The harbour, then the corners of the shore that a shortest path can bend around."""
        return np.vstack([[self._harbour], reflex_vertices(self.room)])

    @cached_property
    def _allowed(self) -> shapely.Polygon:
        allowed = self.room.buffer(1e-6)
        shapely.prepare(allowed)
        return allowed

    def _sees(self, place: tuple[float, float], nodes: Places) -> NDArray[np.bool_]:
        ends = np.broadcast_to(np.asarray(place, dtype=float), nodes.shape)
        lines = shapely.linestrings(np.stack([ends, nodes], axis=1))
        return np.asarray(shapely.covers(self._allowed, lines))

    @cached_property
    def _tree(self) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """For each node the length of the path home, and the next node on it."""
        nodes = self._nodes
        first, second = np.triu_indices(len(nodes), 1)
        lines = shapely.linestrings(np.stack([nodes[first], nodes[second]], axis=1))
        seen = shapely.covers(self._allowed, lines)
        first, second = first[seen].astype(np.int32), second[seen].astype(np.int32)
        away = np.maximum(np.hypot(*(nodes[first] - nodes[second]).T), 1e-9)
        links = csr_array(coo_array((away, (first, second)), shape=(len(nodes), len(nodes))))
        lengths, before = dijkstra(links, directed=False, indices=0, return_predecessors=True)
        return lengths, before

    @property
    def _lengths(self) -> NDArray[np.float64]:
        return self._tree[0]

    @property
    def _onwards(self) -> NDArray[np.int32]:
        return self._tree[1]


def routes_home(water: shapely.Polygon, home: tuple[float, float]) -> RoutesHome:
    """Prepare the paths home within `water`, at the largest clearance that leaves it in one piece.

    A clearance that would cut off more than a twentieth of narrow water is not used. Raises
    `PlanError` when home is on land or the water is too narrow for the smallest clearance.
    """
    if not shapely.intersects_xy(water.buffer(max(CLEARANCES_M)), *home):
        raise PlanError(
            f"Home, {home[0]:.1f} m north and {home[1]:.1f} m east, is not in the survey's water.",
            settings=("home",),
        )
    for clearance in CLEARANCES_M:
        whole = _largest(water.buffer(-clearance))
        if whole is not None and whole.buffer(2 * clearance).area >= 0.95 * water.area:
            room = _drawn_coarser(water, clearance)
            if room is not None:
                return RoutesHome(water=water, home=home, room=room, clearance_m=clearance)
    raise PlanError("The survey's water is too narrow for a route home.")


def _drawn_coarser(water: shapely.Polygon, clearance_m: float) -> shapely.Polygon | None:
    """The water less a clearance, with few enough corners to search; None if the clearance leaves
    nothing.
    """
    best: shapely.Polygon | None = None
    whole = _largest(water.buffer(-clearance_m))
    for share in COARSENESS:
        off = share * clearance_m
        drawn = shapely.simplify(water.buffer(-clearance_m - off), off)
        room = _largest(drawn)
        if room is None or whole is None or room.area < 0.8 * whole.area:
            return best
        # Drawn in by as much as it is then simplified, the shore keeps the clearance.
        room = _largest(shapely.intersection(room, whole, grid_size=SLIVER_M))
        if room is None:
            return best
        best = room
        if shapely.get_num_coordinates(room) <= MOST_CORNERS:
            return best
    return best


def _largest(geometry: shapely.Geometry) -> shapely.Polygon | None:
    parts = [part for part in shapely.get_parts(geometry) if isinstance(part, shapely.Polygon)]
    return max((part for part in parts if part.area > 0), key=lambda part: part.area, default=None)


def _into(room: shapely.Polygon, place: tuple[float, float]) -> tuple[float, float]:
    """The place, or the point of the room nearest to it."""
    point = shapely.Point(place)
    if room.covers(point):
        return place
    ends = shapely.get_coordinates(shapely.shortest_line(point, room))
    north, east = ends[1].tolist()
    return north, east


def transit_survey(
    survey: Survey, routes: RoutesHome, state: tuple[float, ...], speed_max_mps: float
) -> Survey:
    """Return the survey whose only targets are the transits of the path home from a state.

    The hull of each transit and the next is in the water: both are drawn around places between
    which the path keeps its clearance.
    """
    path = routes.path_from((state[0], state[1]))
    steps = np.hypot(*np.diff(path, axis=0).T)
    path = path[np.append(True, steps > 1e-3)]
    if len(path) == 1:
        path = np.vstack([path, [routes.home]])
    radius = WAYPOINT_SHARE * routes.clearance_m
    begin = shapely.Point(path[0]).buffer(START_RADIUS_M, quad_segs=1)
    footprints = [begin, *(shapely.Point(place).buffer(radius, quad_segs=2) for place in path[1:])]
    inner = [
        one if routes.water.covers(one) else _largest(one.intersection(routes.water)) or one
        for one in footprints
    ]
    convex = [hull_of(one.exterior.coords) for one in inner]
    corridors = corridors_between(convex, routes.water, CORRIDOR_REACH_M)
    targets = tuple(
        Target(
            seq=seq,
            kind="transit",
            set=TargetSet(
                vertices=ring_vertices(one), speed_min_mps=-0.1, speed_max_mps=speed_max_mps
            ),
        )
        for seq, one in enumerate(convex[1:], 1)
    )
    return Survey(
        name=f"{survey.name}, the way home",
        frame=survey.frame,
        water=survey.water,
        no_go=survey.no_go,
        targets=targets,
        corridors=tuple(corridors),
        vessel=survey.vessel,
        start=Pose(north_m=state[0], east_m=state[1], heading_rad=state[2]),
    )


def path_length_m(path: Places) -> float:
    """Length [m] of a path (n, 2)."""
    return float(sum(np.hypot(*(b - a)) for a, b in itertools.pairwise(path)))
