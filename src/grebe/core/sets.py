"""Target sets: a convex polygon on the water times a window of surge speed.

The paper's Omega_j (section 6.3) is a box in (x, y, u), free in psi, v and r; here its
footprint is any convex polygon. In half-space form a set is a matrix of rows
(a_x, a_y, a_u, b) with unit normals, and a state belongs to it when
a_x x + a_y y + a_u u <= b holds for every row.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import PlanError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# A polygon still counts as convex if a vertex is this far [m] on the wrong side of its neighbours'
# line: converting it to degrees and back may move it that far.
CONVEXITY_TOLERANCE_M = 1e-6
SHORTEST_EDGE_M = 1e-6
# Shortest side of a corridor [m].
SHORTEST_SIDE_M = 1e-3


@dataclass(frozen=True, kw_only=True)
class TargetSet:
    """One Omega_j.

    `vertices`: ((north, east), ...) in metres, three or more, convex, either orientation.
    `speed_min_mps` < `speed_max_mps`: the window of surge over ground.
    Raises `PlanError` when the polygon is not convex or the window is empty.
    """

    vertices: tuple[tuple[float, float], ...]
    speed_min_mps: float
    speed_max_mps: float

    def __post_init__(self) -> None:
        values = itertools.chain((self.speed_min_mps, self.speed_max_mps), *self.vertices)
        if len(self.vertices) < 3 or not all(map(math.isfinite, values)):
            raise PlanError("A target set needs three or more finite vertices and finite speeds.")
        if not self.speed_min_mps < self.speed_max_mps:
            raise PlanError(
                f"The speed window {self.speed_min_mps}:{self.speed_max_mps} m/s is empty; "
                "give the lower speed first."
            )
        farthest = max(a * x + b * y - c for a, b, c in self._sides for x, y in self.vertices)
        if farthest > CONVEXITY_TOLERANCE_M:
            raise PlanError("A target set must be a convex polygon without repeated vertices.")

    @classmethod
    def known_good(
        cls, vertices: tuple[tuple[float, float], ...], speed_min_mps: float, speed_max_mps: float
    ) -> TargetSet:
        """Return a set without checking that its footprint is convex and its window not empty."""
        one = object.__new__(cls)
        vars(one).update(
            vertices=vertices, speed_min_mps=speed_min_mps, speed_max_mps=speed_max_mps
        )
        return one

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The footprint, x north and y east."""
        return shapely.Polygon(self.vertices)

    @cached_property
    def centre(self) -> tuple[float, float]:
        """Centroid of the footprint (north, east) [m]."""
        (x0, y0), *others = self.vertices
        area = north = east = 0.0
        # Triangles about the first corner lose fewer digits far from the origin.
        for (ax, ay), (bx, by) in itertools.pairwise((x - x0, y - y0) for x, y in others):
            twice = ax * by - bx * ay
            area += twice
            north += twice * (ax + bx)
            east += twice * (ay + by)
        return x0 + north / (3.0 * area), y0 + east / (3.0 * area)

    @cached_property
    def _sides(self) -> list[tuple[float, float, float]]:
        """Half-spaces of the footprint: (a, b, c) with a x + b y <= c.

        Plain numbers, because there are a hundred thousand sets, and the next one is queried ten
        times a second.
        """
        ring = list(zip(self.vertices, (*self.vertices[1:], self.vertices[0]), strict=True))
        outward = math.copysign(1.0, sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in ring))
        sides: list[tuple[float, float, float]] = []
        for (x0, y0), (x1, y1) in ring:
            length = math.hypot(x1 - x0, y1 - y0)
            if length < SHORTEST_EDGE_M:
                raise PlanError("A target set must be a convex polygon without repeated vertices.")
            a, b = outward * (y1 - y0) / length, outward * (x0 - x1) / length
            sides.append((a, b, a * x0 + b * y0))
        return sides

    @cached_property
    def halfspaces(self) -> NDArray[np.float64]:
        """Rows (a_x, a_y, a_u, b) of the set in (x, y, u); the last two are the window."""
        window = [(0.0, 0.0, -1.0, -self.speed_min_mps), (0.0, 0.0, 1.0, self.speed_max_mps)]
        return np.array([*((a, b, 0.0, c) for a, b, c in self._sides), *window])

    def contains(self, state: Sequence[float]) -> bool:
        """Return whether a state (x, y, psi, u, v, r) is in the closed set."""
        return self.covers(state[0], state[1]) and self.allows(state[3])

    def covers(self, north_m: float, east_m: float) -> bool:
        """Return whether a position is in the closed footprint."""
        return all(a * north_m + b * east_m <= c for a, b, c in self._sides)

    def allows(self, surge_mps: float) -> bool:
        """Return whether a surge is in the closed speed window."""
        return self.speed_min_mps <= surge_mps <= self.speed_max_mps

    def distance(self, state: Sequence[float]) -> float:
        """d(z, Omega): Euclidean distance in (x, y, u), metres beside metres per second.

        A generalised distance in the sense of Definition 2: convex, continuous, zero
        exactly inside.
        """
        return math.hypot(self.footprint_distance(state[0], state[1]), self.speed_excess(state[3]))

    def footprint_distance(self, north_m: float, east_m: float) -> float:
        """Distance [m] of a position from the footprint, zero inside."""
        if self.covers(north_m, east_m):
            return 0.0
        nearest = math.inf
        for (x, y), (to_x, to_y) in zip(
            self.vertices, (*self.vertices[1:], self.vertices[0]), strict=True
        ):
            edge_x, edge_y, off_x, off_y = to_x - x, to_y - y, north_m - x, east_m - y
            along = (off_x * edge_x + off_y * edge_y) / (edge_x * edge_x + edge_y * edge_y)
            along = min(max(along, 0.0), 1.0)
            nearest = min(nearest, math.hypot(off_x - along * edge_x, off_y - along * edge_y))
        return nearest

    def speed_excess(self, surge_mps: float) -> float:
        """Distance [m/s] of a surge from the window, zero inside."""
        return max(self.speed_min_mps - surge_mps, surge_mps - self.speed_max_mps, 0.0)

    def shrunk(self, margin_m: float, speed_margin_mps: float) -> TargetSet:
        """Return the set moved inwards by a margin on every side.

        So that something is left, the speed margin is at most a quarter of the window, and the
        footprint's margin at most half of area over perimeter: no convex polygon has a smaller
        inscribed radius.
        """
        polygon = self.polygon
        inset = min(margin_m, 0.5 * polygon.area / polygon.length)
        slack = min(speed_margin_mps, 0.25 * (self.speed_max_mps - self.speed_min_mps))
        inner = polygon.buffer(-inset, join_style="mitre") if inset > SHORTEST_EDGE_M else polygon
        return TargetSet(
            vertices=ring_vertices(inner),
            speed_min_mps=self.speed_min_mps + slack,
            speed_max_mps=self.speed_max_mps - slack,
        )


def sets_of(
    rings: Sequence[tuple[tuple[float, float], ...]], windows: Sequence[tuple[float, float]]
) -> list[TargetSet]:
    """Return the target sets of many rings and speed windows: `TargetSet`, vectorised."""
    good = _are_convex(rings)
    return [
        TargetSet.known_good(ring, low, high)
        if is_good and -math.inf < low < high < math.inf
        else TargetSet(vertices=ring, speed_min_mps=low, speed_max_mps=high)
        for ring, (low, high), is_good in zip(rings, windows, good, strict=True)
    ]


def _are_convex(rings: Sequence[tuple[tuple[float, float], ...]]) -> list[bool]:
    """Return whether each ring is clearly a convex polygon; False in borderline cases too."""
    good = np.zeros(len(rings), dtype=bool)
    sizes = np.array([len(ring) for ring in rings])
    for size in np.unique(sizes[sizes >= 3]).tolist():
        those = np.flatnonzero(sizes == size)
        ring = np.array([rings[k] for k in those.tolist()])
        edge = np.roll(ring, -1, axis=1) - ring
        length = np.hypot(edge[..., 0], edge[..., 1])
        # Twice the area of the triangle of each edge with each corner.
        off = ring[:, None] - ring[:, :, None]
        left = edge[..., None, 0] * off[..., 1] - edge[..., None, 1] * off[..., 0]
        inwards = np.where(left.sum(axis=(1, 2)) < 0, -1.0, 1.0)[:, None, None] * left
        good[those] = (length.min(axis=1) >= SHORTEST_EDGE_M) & np.all(
            inwards >= -0.5 * CONVEXITY_TOLERANCE_M * length[..., None], axis=(1, 2)
        )
    return good.tolist()


def ring_vertices(polygon: shapely.Polygon) -> tuple[tuple[float, float], ...]:
    """Return the outer ring's vertices, each once."""
    return rings_of([polygon])[0]


def rings_of(polygons: Sequence[shapely.Polygon]) -> list[tuple[tuple[float, float], ...]]:
    """Return the vertices of each polygon's outer ring, each once: `ring_vertices`, vectorised."""
    rings = shapely.get_exterior_ring(np.array(polygons, dtype=object))
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    ends = np.searchsorted(ring, np.arange(len(polygons) + 1)).tolist()
    places = list(map(tuple, corners.tolist()))
    return [tuple(places[a : b - 1]) for a, b in itertools.pairwise(ends)]


def drawn_in(
    ring: tuple[tuple[float, float], ...], share: float
) -> tuple[tuple[float, float], ...]:
    """Return a convex ring scaled about its centroid to a share of its size."""
    middle = shapely.Polygon(ring).centroid
    return tuple(
        (middle.x + share * (x - middle.x), middle.y + share * (y - middle.y)) for x, y in ring
    )


def footprints_of(sets: Sequence[TargetSet]) -> NDArray[np.object_]:
    """Return the footprints of many sets as polygons."""
    return polygons_of([one.vertices for one in sets])


def polygons_of(rings: Sequence[tuple[tuple[float, float], ...]]) -> NDArray[np.object_]:
    """Return the polygons bounded by many rings."""
    corners = np.array([vertex for one in rings for vertex in one]).reshape(-1, 2)
    ring = np.repeat(np.arange(len(rings)), [len(one) for one in rings])
    return np.asarray(shapely.polygons(shapely.linearrings(corners, indices=ring)), dtype=object)


def rectangle(
    north: tuple[float, float], east: tuple[float, float], speed: tuple[float, float]
) -> TargetSet:
    """Return the axis-parallel box of section 6.3: [l_x, u_x] x [l_y, u_y] x [l_u, u_u]."""
    (n0, n1), (e0, e1) = north, east
    return TargetSet(
        vertices=((n0, e0), (n1, e0), (n1, e1), (n0, e1)),
        speed_min_mps=speed[0],
        speed_max_mps=speed[1],
    )


# A margin takes at most this share of the radius of the largest circle in a polygon.
MARGIN_SHARE = 0.25


def polygon_rows(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """Half-space rows (a_x, a_y, 0, b) of a convex polygon on the water, for a corridor.

    Clipping and rounding leave sides shorter than a millimetre; these get no row. Every vertex
    satisfies every row.
    """
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon.convex_hull))
    edge = np.diff(ring, axis=0)
    length = np.hypot(edge[:, 0], edge[:, 1])
    normal = np.column_stack([edge[:, 1], -edge[:, 0]])[length > SHORTEST_SIDE_M]
    normal = normal / length[length > SHORTEST_SIDE_M, None]
    offset = np.max(normal @ ring.T, axis=1)
    return np.column_stack([normal, np.zeros(len(normal)), offset])


def inner_rows(polygon: shapely.Polygon, margin_m: float) -> NDArray[np.float64]:
    """Rows of a convex polygon moved inwards by a margin, which is cut in a narrow polygon.

    If little room were left, a boat could pass only at a penalty and would rather wait outside.
    """
    radius = shapely.length(shapely.maximum_inscribed_circle(polygon))
    aside = min(margin_m, MARGIN_SHARE * float(radius))
    return polygon_rows(polygon) - np.array([0.0, 0.0, 0.0, aside])


def hull_of(points: ArrayLike) -> shapely.Polygon:
    """Return the convex hull of (n, 2) points; `PlanError` when it has no area."""
    hull = shapely.MultiPoint(np.asarray(points, dtype=float)).convex_hull
    if not isinstance(hull, shapely.Polygon):
        raise PlanError("All the points lie on one line: their convex hull has no area.")
    return hull
