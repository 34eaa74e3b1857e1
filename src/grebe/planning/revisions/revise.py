"""Replan the rest of an order: a pure function from a boat's position to a revision.

Targets that were reached stay in front, unchanged. The remaining cells, without those that are
closed or out of reach, are put in the fastest order from the boat's position in the estimated
weather. Paths around land and corridors are made anew.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision, Reason, Sortie, numbered_on, revised, survey_of
from grebe.core.sets import TargetSet, footprints_of, ring_vertices
from grebe.core.survey import Survey, Target
from grebe.core.taut import taut_path
from grebe.core.vessel import Vessel
from grebe.planning.cells.mesh import Cell, target_footprint, wide_pieces
from grebe.planning.paths.corridors import REACH_CELLS, PathFinder, Stop, corridors_of, widened
from grebe.planning.paths.graph import parts_of
from grebe.planning.paths.network import ROUNDING_M, Network, connect
from grebe.planning.paths.travel import travel_of
from grebe.planning.route.costs import costs_of
from grebe.planning.route.polish import polished

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Radius of the footprint of the boat's place, for its hull with the first target [m].
PLACE_RADIUS_M = 0.05
# Kicks of the polish, as many as there is time for while a boat sails.
KICKS = 2_000


@dataclass(frozen=True, kw_only=True)
class OpenWater:
    """The cells of a survey and the paths between them, without closed areas.

    `water` is the water that the boat may use; `targets` are those of the cells, in the same order.
    Measuring the paths takes most of the time of replanning, and is done before it is needed.
    """

    water: shapely.Polygon
    targets: tuple[Target, ...]
    cell_m: float

    @cached_property
    def cells(self) -> list[Cell]:
        """The targets' cells as in the planner's mesh, followed by the pieces of water between
        them, which may only be passed: water in no target, and the rest of partly closed cells.
        """
        shapes = footprints_of([target.set for target in self.targets])
        whole = self.cell_m**2 * (1 - 1e-6)
        targets = [
            Cell(row=0, column=i, footprint=shape, whole=shape.area >= whole)
            for i, shape in enumerate(shapes.tolist())
        ]
        between = shapely.difference(self.water, shapely.union_all(shapes))
        finder = [
            Cell(row=1, column=i, footprint=piece, is_speck=True)
            for i, piece in enumerate(wide_pieces(between))
        ]
        return [*targets, *finder]

    @cached_property
    def network(self) -> Network:
        """Which cells a boat can go between."""
        return connect(self.cells, self.water, self.cell_m)

    @cached_property
    def finder(self) -> PathFinder:
        """The paths between the cells."""
        return PathFinder(self.cells, self.network, self.water, self.cell_m)

    @cached_property
    def _parts(self) -> NDArray[np.int64]:
        return parts_of(self.network.links(self.network.lengths_m))[1]

    @cached_property
    def shapes(self) -> NDArray[np.object_]:
        """The footprints of the cells."""
        return np.array([cell.footprint for cell in self.cells], dtype=object)

    def nearest(self, place: shapely.Geometry) -> int:
        """The cell that is nearest to a place."""
        return int(np.argmin(shapely.distance(self.shapes, place)))

    def within_reach(self, place: tuple[float, float]) -> NDArray[np.bool_]:
        """Which cells a boat can reach from a place."""
        return self._parts == self._parts[self.nearest(shapely.Point(place))]

    @cached_property
    def place_of(self) -> dict[int, int]:
        """The index of each target's cell, by the target's number."""
        return {target.seq: i for i, target in enumerate(self.targets)}

    def closing(self, zones: Sequence[shapely.Polygon], place: tuple[float, float]) -> OpenWater:
        """Return the open water that is left when zones are closed: the part that contains the
        boat's place, or is nearest to it, with the cells that are completely inside.

        Raises `PlanError` when no cell is left.
        """
        left = shapely.difference(self.water, shapely.union_all(list(zones)))
        parts = [p for p in shapely.get_parts(left) if isinstance(p, shapely.Polygon) and p.area]
        if not parts:
            raise PlanError("With the area closed, no water is left.")
        here = shapely.Point(place)
        water = min(parts, key=lambda part: part.distance(here))
        shapes = footprints_of([target.set for target in self.targets])
        allowed = water.buffer(ROUNDING_M, join_style="mitre")
        shapely.prepare(allowed)
        stays = shapely.covers(allowed, shapes)
        kept = tuple(itertools.compress(self.targets, stays.tolist()))
        if not kept:
            raise PlanError("With the area closed, the boat can reach no more cells.")
        return replace(self, water=water, targets=kept)


def open_water(survey: Survey, water: shapely.Polygon) -> OpenWater:
    """Return all cells of a survey in the water that its boat may use."""
    if survey.outcome is None:
        raise PlanError("The survey does not say how large its cells are; plan it first.")
    cells = tuple(target for target in survey.targets if target.kind == "cell")
    return OpenWater(water=water, targets=cells, cell_m=survey.outcome.cell_m)


@dataclass(frozen=True, kw_only=True)
class Halfway:
    """How far an order, or its `sortie`, has come: the number of `reached` targets, and the boat's
    `place` (north, east).
    """

    reached: int
    place: tuple[float, float]
    sortie: Sortie | None = None


def replanned(
    old: PlanRevision,
    survey: Survey,
    open_: OpenWater,
    halfway: Halfway,
    *,
    vessel: Vessel,
    weather: Weather,
    reason: Reason,
    note: str,
    without: Collection[int] = (),
) -> PlanRevision:
    """Return the revision in which the rest is replanned. Raises `PlanError` when nothing is left.

    `without` are the numbers of targets to leave out. A sortie still ends at its harbour; the other
    sorties stay unchanged.
    """
    part = survey_of(survey, old, halfway.sortie)
    within_reach = open_.within_reach(halfway.place)
    rest = [
        open_.place_of[t.seq]
        for t in part.targets[halfway.reached :]
        if t.kind == "cell" and t.seq in open_.place_of and t.seq not in without
    ]
    rest = [cell for cell in rest if within_reach[cell]]
    if not rest:
        raise PlanError("No cell is left to visit.")
    return put_in_order(
        old, survey, open_, halfway, rest, vessel=vessel, weather=weather, reason=reason, note=note
    )


def put_in_order(
    old: PlanRevision,
    survey: Survey,
    open_: OpenWater,
    halfway: Halfway,
    rest: Sequence[int],
    *,
    vessel: Vessel,
    weather: Weather,
    reason: Reason,
    note: str,
) -> PlanRevision:
    """Return the revision in which the boat goes on to some cells of the open water, in the fastest
    order. `rest` are the cells' indices.
    """
    part = survey_of(survey, old, halfway.sortie)
    done = part.targets[: halfway.reached]
    ends_at = part.targets[-1] if part.targets[-1].kind == "transit" else None
    targets, corridors = path_through_cells(
        old, survey, open_, halfway, rest, ends_at, vessel=vessel, weather=weather
    )
    ahead = [*done, *targets], [*part.corridors[: halfway.reached], *corridors]
    return joined(old, halfway.sortie, *ahead, reason=reason, note=note)


def path_through_cells(
    old: PlanRevision, survey: Survey, open_: OpenWater, halfway: Halfway, rest: Sequence[int],
    ends_at: Target | None, *, vessel: Vessel, weather: Weather,
) -> tuple[list[Target], list[shapely.Polygon]]:  # fmt: skip
    """Return the targets and corridors of the fastest order of some cells of the open water, with
    transits, from the boat's place to the target at which the order has to end, if any.
    """
    cells = np.array(rest, dtype=np.int64)
    order = _ordered(survey, open_, halfway, ends_at, vessel, weather, cells)
    stops = _stops(open_, halfway.place, order, ends_at)
    begin = shapely.Point(halfway.place).buffer(PLACE_RADIUS_M, quad_segs=1)
    corridors = _corridors(old, open_, begin, stops)
    fastest = max(target.set.speed_max_mps for target in survey.targets)
    return _targets(old, open_, widened(stops, corridors), fastest, ends_at), corridors


def remaining_s(
    survey: Survey, place: tuple[float, float], ahead: Sequence[Target], weather: Weather,
    vessel: Vessel,
) -> float:  # fmt: skip
    """Predicted time [s] of the taut path from a place through targets."""
    settings = survey.settings
    if settings is None or not ahead:
        return 0.0
    travel = travel_of(vessel, (settings.speed_min_mps, settings.speed_max_mps), weather)
    return travel.path_s(taut_path(place, footprints_of([target.set for target in ahead])))


def _ordered(
    survey: Survey, open_: OpenWater, halfway: Halfway, ends_at: Target | None, vessel: Vessel,
    weather: Weather, rest: NDArray[np.int64],
) -> NDArray[np.int64]:  # fmt: skip
    settings = survey.settings
    assert settings is not None
    travel = travel_of(vessel, (settings.speed_min_mps, settings.speed_max_mps), weather)
    # A sortie without a harbour, a boat's share of a fleet's survey, does not come back.
    returns = halfway.sortie is not None and ends_at is not None
    costs = costs_of(open_.network, travel, halfway.place, returns=returns)
    if len(rest) < 2:
        return rest
    # The polish counts legs through the centres only, so its order must also be predicted faster.
    return min(
        polished(costs, rest, KICKS)[0],
        rest,
        key=lambda order: travel.path_s(taut_path(halfway.place, open_.shapes[order])),
    )


def _stops(
    open_: OpenWater, place: tuple[float, float], order: NDArray[np.int64], ends_at: Target | None
) -> list[Stop]:
    """Cells and transits from the boat's place, and back to where the order has to end."""
    finder = open_.finder
    stops = finder.stops(order)
    begin = np.array([shapely.Point(place).buffer(PLACE_RADIUS_M, quad_segs=1)], dtype=object)
    if not finder.straight(begin, np.array([stops[0].footprint], dtype=object))[0]:
        here = open_.nearest(begin[0])
        gate = Stop(footprint=open_.cells[here].footprint, cell=None)
        first = int(order[0])
        transits = finder.around(here, first) if here != first else []
        stops = [*([gate] if here != first else []), *transits, *stops]
    if ends_at is not None:
        berth = ends_at.set.polygon
        if not shapely.dwithin(open_.water, berth, open_.cell_m):
            raise PlanError("A closed area cuts off the harbour.")
        home = open_.nearest(berth.centroid)
        last = int(order[-1])
        transits = finder.around(last, home) if last != home else []
        stops = [*stops, *transits, Stop(footprint=berth, cell=None)]
    return stops


def _corridors(
    old: PlanRevision, open_: OpenWater, begin: shapely.Polygon, stops: Sequence[Stop]
) -> list[shapely.Polygon]:
    """A corridor for each leg: that of the old order if it has the same leg, in either direction.

    Cutting corridors out of the water is most of the work of a plan, and a new order keeps most
    legs of the old one.
    """
    known = _known_corridors(old, open_.water)
    shapes = np.array([begin, *(stop.footprint for stop in stops)], dtype=object)
    numbers = [0, *(0 if s.cell is None else open_.targets[s.cell].seq for s in stops)]
    legs = [frozenset(pair) for pair in itertools.pairwise(numbers)]
    found = [known.get(leg) for leg in legs]
    missing = [k for k, corridor in enumerate(found) if corridor is None]
    reach_m = REACH_CELLS * open_.cell_m
    ends = [k + 1 for k in missing]
    cut = corridors_of(shapes[missing], shapes[ends], open_.water, reach_m)
    made = dict(zip(missing, cut, strict=True))
    return [made[k] if one is None else one for k, one in enumerate(found)]


def _known_corridors(
    old: PlanRevision, water: shapely.Polygon
) -> dict[frozenset[int], shapely.Polygon]:
    """The corridors of the old order's legs from cell to cell that are still water."""
    legs = [
        (frozenset((a.seq, b.seq)), corridor)
        for (a, b), corridor in zip(
            itertools.pairwise(old.targets), old.corridors[1:], strict=False
        )
        if a.kind == b.kind == "cell"
    ]
    allowed = water.buffer(ROUNDING_M, join_style="mitre")
    shapely.prepare(allowed)
    stays = shapely.covers(allowed, np.array([corridor for _, corridor in legs], dtype=object))
    return dict(itertools.compress(legs, np.atleast_1d(stays).tolist()))


def _targets(
    old: PlanRevision,
    open_: OpenWater,
    stops: Sequence[Stop],
    fastest_mps: float,
    ends_at: Target | None,
) -> list[Target]:
    """The targets of stops: the cells' own, new transits, and the old end."""
    body = stops if ends_at is None else stops[:-1]
    new = transits_of(old, [stop for stop in body if stop.cell is None], fastest_mps)
    numbered = iter(new)
    found = [next(numbered) if s.cell is None else open_.targets[s.cell] for s in body]
    return found if ends_at is None else [*found, ends_at]


def transits_of(old: PlanRevision, stops: Sequence[Stop], fastest_mps: float) -> tuple[Target, ...]:
    """Return stops as new transit targets, numbered consecutively after those of an old order."""
    rings = [target_footprint(ring_vertices(stop.footprint)) for stop in stops]
    sets = [TargetSet(vertices=r, speed_min_mps=0.0, speed_max_mps=fastest_mps) for r in rings]
    return numbered_on(old, [Target(seq=1, kind="transit", set=one) for one in sets])


def joined(
    old: PlanRevision, sortie: Sortie | None, targets: Sequence[Target],
    corridors: Sequence[shapely.Polygon], *, reason: Reason, note: str,
) -> PlanRevision:  # fmt: skip
    """Return the complete order, in which a sortie has new targets and corridors."""
    if sortie is None:
        return revised(old, reason=reason, note=note, targets=targets, corridors=corridors)
    before, behind = sortie.first - 1, sortie.last
    grown = len(targets) - len(sortie)
    sorties: list[Sortie] = []
    for one in old.sorties:
        if one.number == sortie.number:
            sorties.append(replace(one, last=one.last + grown))
        elif one.first > sortie.first:
            sorties.append(replace(one, first=one.first + grown, last=one.last + grown))
        else:
            sorties.append(one)
    return revised(
        old,
        reason=reason,
        note=note,
        targets=[*old.targets[:before], *targets, *old.targets[behind:]],
        corridors=[*old.corridors[:before], *corridors, *old.corridors[behind:]],
        sorties=sorties,
    )
