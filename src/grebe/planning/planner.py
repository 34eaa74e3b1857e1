"""Plan a survey of a region: water, mesh, links, order, transits, corridors, and its figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanOutcome, PlanSettings, check_speed
from grebe.core.sets import drawn_in, footprints_of, polygons_of, rings_of, sets_of
from grebe.core.survey import Pose, Survey, Target
from grebe.core.taut import taut_path
from grebe.core.vessel import Vessel
from grebe.planning.budget import SMALLEST_CELL_M, affordable_cell_m
from grebe.planning.cells.mesh import Cell, target_footprint
from grebe.planning.check import check_plan
from grebe.planning.paths.connected_mesh import connected_mesh
from grebe.planning.paths.corridors import PathFinder, Stop, widened
from grebe.planning.paths.network import Network
from grebe.planning.paths.travel import Travel, travel_of
from grebe.planning.planned import Planned
from grebe.planning.region import Region, coarsened, navigable_water
from grebe.planning.route.bounds import lower_bound_m
from grebe.planning.route.portfolio import Route, best_route

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Directions of the rows that are tried when none is given [deg]; above `MANY_CELLS` cells only
# every third of them.
ANGLES_DEG = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
MANY_CELLS = 2_500
# A coast with more vertices than this is simplified, to within this share of a cell.
MANY_VERTICES, COAST_SHARE = 10_000, 0.1
# A plan that uses less than this share of its budget says so.
WELL_USED = 0.9
# A change of bearing larger than this counts as a turn [rad].
TURN_RAD = math.radians(30)
# Radius of the start's footprint, for its hull with the first target [m].
START_RADIUS_M = 0.05


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A meshed and ordered region, before transits and corridors.

    For a sortie, `harbour` is the footprint in which the order ends. It is a part of the cell
    `home`, in which the order begins.
    """

    cells: list[Cell]
    network: Network
    route: Route
    start: tuple[float, float]
    cell_m: float
    angle_deg: float
    harbour: shapely.Polygon | None = None
    home: int | None = None


def plan_survey(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
) -> Survey:
    """Plan a survey; see `plan`."""
    return plan(region, vessel, settings, start_lonlat, no_go).survey


def plan(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
) -> Planned:
    """Plan a survey of a region. Raises `PlanError` with the reason when there is no plan.

    `no_go` are local polygons that the boat must stay out of. Without a start the boat
    begins in the cell nearest to the region's south-western corner.
    """
    planner, notes = planner_of(region, vessel, settings, start_lonlat, no_go)
    return planner.planned(notes)


def planner_of(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
) -> tuple[Planner, tuple[str, ...]]:
    """Return the planner of a region, and notes about its water; see `plan`."""
    check_speed(settings, vessel)
    given = start_lonlat and region.frame.place_near(region.water, start_lonlat, "start")
    region, told = _with_coast(region, settings)
    water, notes = navigable_water(region, no_go, settings.shore_margin_m, given)
    return Planner(region, vessel, settings, tuple(no_go), water, given), told + notes


def _with_coast(region: Region, settings: PlanSettings) -> tuple[Region, tuple[str, ...]]:
    """The region, with its coast simplified if set or if it has very many vertices, and notes."""
    tolerance_m = settings.coast_tolerance_m
    if tolerance_m is None:
        many = shapely.get_num_coordinates(region.water) > MANY_VERTICES
        tolerance_m = COAST_SHARE * (settings.cell_m or SMALLEST_CELL_M) if many else 0.0
    return coarsened(region, tolerance_m) if tolerance_m > 0 else (region, ())


@dataclass(frozen=True)
class Planner:
    """Plans one region: mesh, links, order, and the targets of an order."""

    region: Region
    vessel: Vessel
    settings: PlanSettings
    no_go: tuple[shapely.Polygon, ...]
    water: shapely.Polygon
    given_start: tuple[float, float] | None
    travel: Travel = field(init=False)

    def __post_init__(self) -> None:
        window = (self.settings.speed_min_mps, self.settings.speed_max_mps)
        travel = travel_of(self.vessel, window, self.settings.weather)
        object.__setattr__(self, "travel", travel)

    def planned(self, notes: tuple[str, ...]) -> Planned:
        """Return the plan with its check; `notes` are passed on."""
        draft = self.first_draft(quick=False)
        finder = PathFinder(draft.cells, draft.network, self.water, draft.cell_m)
        survey = self.survey(draft, finder)
        outcome = survey.outcome
        assert outcome is not None
        if self.settings.cell_m is None:
            notes += self._unused(draft)
        return Planned(
            survey=survey, outcome=outcome, check=check_plan(survey, self.water), notes=notes
        )

    def _unused(self, draft: Draft) -> tuple[str, ...]:
        """A note if much of the budget is left, because one lane more would exceed it."""
        share = self._spent_s(draft) / self._budget_s()
        if share >= WELL_USED:
            return ()
        what = "time" if self.settings.minutes is not None else "energy"
        return (
            f"The plan uses {100 * share:.0f} % of the {what}: with smaller cells one more lane "
            "fits into the water, which takes too long. Lanes in another direction may fit better.",
        )

    def first_draft(self, *, quick: bool) -> Draft:
        """Return a draft with cells of the size and direction in the settings, or the best ones."""
        cell_m = self.settings.cell_m
        if cell_m is None:
            return self._affordable(quick=quick)
        return self.draft(cell_m, self._angle(cell_m), quick=quick)

    def survey(self, draft: Draft, finder: PathFinder, bound_m: float | None = None) -> Survey:
        """Return the survey of a draft's order: targets, transits, corridors and its figures.

        `bound_m` is the lower bound of its length (None: it is computed).
        """
        stops = self._stops(draft, finder)
        corridors = self._corridors(draft, stops, finder)
        stops = widened(stops, corridors)
        targets = self._targets(draft, stops)
        return self._survey(
            draft, targets, corridors, self._outcome(draft, stops, targets, bound_m)
        )

    def draft(self, cell_m: float, angle_deg: float, *, quick: bool) -> Draft:
        """Return a mesh of the water and an order of its cells."""
        corner = self.given_start or _south_west(self.water)
        cells, network = connected_mesh(
            self.water, cell_m, shape=self.settings.shape, angle_deg=angle_deg, near=corner
        )
        if all(cell.is_speck for cell in cells):
            raise PlanError(
                f"The water is too narrow for cells of {cell_m:g} m: no cell has enough water to "
                "be a target; choose smaller cells or a smaller shore margin.",
                settings=("cell_m", "shore_margin_m"),
            )
        start = self.given_start or self._nearest_centre(network, corner)
        route = best_route(
            cells, network, self.travel, start, returns=self.settings.returns,
            anywhere=self.given_start is None, quick=quick,
            pattern=self.settings.pattern,
        )  # fmt: skip
        if self.given_start is None and not self.settings.returns:
            start = tuple(network.centres[route.order[0]].tolist())
        return Draft(
            cells=cells, network=network, route=route, start=start, cell_m=cell_m,
            angle_deg=angle_deg,
        )  # fmt: skip

    @staticmethod
    def _nearest_centre(network: Network, place: tuple[float, float]) -> tuple[float, float]:
        i = int(np.argmin(np.hypot(*(network.centres - place).T)))
        north, east = network.centres[i].tolist()
        return north, east

    def _angle(self, cell_m: float) -> float:
        """The direction in the settings, or the one whose quick plan has the fastest legs."""
        if self.settings.angle_deg is not None:
            return self.settings.angle_deg
        angles = [
            *ANGLES_DEG[:: 3 if self.water.area / cell_m**2 > MANY_CELLS else 1],
            _long_side_deg(self.water),
        ]

        def legs_s(angle: float) -> float:
            return self.draft(cell_m, angle, quick=True).route.legs_s

        return min(angles, key=legs_s)

    def _affordable(self, *, quick: bool) -> Draft:
        """A draft whose cells keep the budget, in the direction of the settings, or else in the one
        with the fastest legs or along north, whichever affords smaller cells.
        """
        if self.settings.angle_deg is not None:
            return self._affordable_at(self.settings.angle_deg, quick=quick)
        north = self._affordable_at(0.0, quick=quick)
        fastest = self._angle(north.cell_m)
        if fastest == 0.0:
            return north
        return min(north, self._affordable_at(fastest, quick=quick), key=lambda one: one.cell_m)

    def _affordable_at(self, angle_deg: float, *, quick: bool) -> Draft:
        """A draft in a direction, whose cells keep the budget."""
        only_quick, times = quick, dict[tuple[float, bool], float]()
        last: list[Draft] = []

        def spent_s(cell_m: float, *, quick: bool) -> float:
            quick = quick or only_quick
            if (cell_m, quick) not in times:
                draft = self.draft(cell_m, angle_deg, quick=quick)
                times[cell_m, quick] = self._spent_s(draft)
                if quick == only_quick:
                    last[:] = [draft]
            return times[cell_m, quick]

        budget_s, pace = self._budget_s(), 1 / float(np.mean(self.travel.slowness))
        first_m, largest_m = self.water.area / (pace * budget_s), math.sqrt(self.water.area)
        many_below_m = math.sqrt(self.water.area / MANY_CELLS)
        cell_m = affordable_cell_m(spent_s, budget_s, first_m, largest_m, many_below_m=many_below_m)
        if last[0].cell_m == cell_m:
            return last[0]
        return self.draft(cell_m, angle_deg, quick=quick)

    def _spent_s(self, draft: Draft) -> float:
        """The part of the budget that a plan uses [s], transits included: its time, or the time for
        which its energy would last a boat that goes straight.
        """
        finder = PathFinder(draft.cells, draft.network, self.water, draft.cell_m)
        path = self._path_through(draft, self._targets(draft, self._stops(draft, finder)))
        if self.settings.minutes is not None:
            return self.travel.path_s(path)
        return 3600.0 * self.travel.path_wh(path) / self.travel.power_w

    @staticmethod
    def _path_through(draft: Draft, targets: Sequence[Target]) -> NDArray[np.float64]:
        """The shortest path through targets, (n, 2)."""
        return taut_path(draft.start, footprints_of([target.set for target in targets]))

    def mean_power_w(self, draft: Draft) -> float:
        """The mean power of a draft [W], turns included."""
        shapes = [draft.cells[i].footprint for i in draft.route.order.tolist()]
        return self.travel.mean_power_w(taut_path(draft.start, shapes))

    def _budget_s(self) -> float:
        if self.settings.minutes is not None:
            return 60.0 * self.settings.minutes
        return 3600.0 * (self.settings.energy_wh or 0.0) / self.travel.power_w

    def _stops(self, draft: Draft, finder: PathFinder) -> list[Stop]:
        """Cells and transits: from the start, through all cells, and back if required."""
        stops = finder.stops(draft.route.order)
        nearest = int(np.argmin(np.hypot(*(draft.network.centres - draft.start).T)))
        home = nearest if draft.home is None else draft.home
        pair = np.array([self._start_footprint(draft)], dtype=object)
        if not finder.straight(pair, np.array([stops[0].footprint], dtype=object))[0]:
            gate = Stop(footprint=draft.cells[home].footprint, cell=None)
            first = int(draft.route.order[0])
            stops = [
                *([gate] if home != first else []),
                *self._transits(finder, home, first),
                *stops,
            ]
        if self.settings.returns or draft.harbour is not None:
            last = int(draft.route.order[-1])
            place = draft.harbour or draft.cells[home].footprint
            ends = home != last or draft.harbour is not None
            back = [Stop(footprint=place, cell=None)] if ends else []
            stops = [*stops, *self._transits(finder, last, home), *back]
        return stops

    @staticmethod
    def _transits(finder: PathFinder, a: int, b: int) -> list[Stop]:
        return [] if a == b else finder.around(a, b)

    @staticmethod
    def _start_footprint(draft: Draft) -> shapely.Polygon:
        return shapely.Point(draft.start).buffer(START_RADIUS_M, quad_segs=1)

    def _corridors(
        self, draft: Draft, stops: list[Stop], finder: PathFinder
    ) -> list[shapely.Polygon]:
        footprints = [self._start_footprint(draft), *(stop.footprint for stop in stops)]
        return finder.corridors(footprints)

    def _survey(
        self,
        draft: Draft,
        targets: tuple[Target, ...],
        corridors: list[shapely.Polygon],
        outcome: PlanOutcome,
    ) -> Survey:
        north, east = targets[0].set.centre
        heading = math.atan2(east - draft.start[1], north - draft.start[0])
        return Survey(
            name=self.region.name,
            frame=self.region.frame,
            water=self.region.water,
            no_go=self.no_go,
            targets=targets,
            corridors=tuple(corridors),
            vessel=self.vessel,
            start=Pose(north_m=draft.start[0], east_m=draft.start[1], heading_rad=heading),
            settings=self.settings,
            outcome=outcome,
        )

    def _targets(self, draft: Draft, stops: list[Stop]) -> tuple[Target, ...]:
        rings = [
            ring if self._is_whole(draft, stop) else target_footprint(ring)
            for stop, ring in zip(stops, rings_of([stop.footprint for stop in stops]), strict=True)
        ]
        cells = [
            cell if stop.cell is not None else None
            for stop, cell in zip(stops, polygons_of(rings).tolist(), strict=True)
        ]
        if self.settings.core < 1:
            rings = [
                ring if cell is None else drawn_in(ring, self.settings.core)
                for ring, cell in zip(rings, cells, strict=True)
            ]
        slowest, fastest = self.settings.speed_min_mps, self.settings.speed_max_mps
        windows = [(0.0 if cell is None else slowest, fastest) for cell in cells]
        return tuple(
            Target(seq=seq, kind="transit" if cell is None else "cell", cell=cell, set=one)
            for seq, (cell, one) in enumerate(
                zip(cells, sets_of(rings, windows), strict=True), start=1
            )
        )

    @staticmethod
    def _is_whole(draft: Draft, stop: Stop) -> bool:
        return stop.cell is not None and draft.cells[stop.cell].whole

    def bound_m(self, draft: Draft) -> float:
        """Return a lower bound [m] of the length of any path through the centres of all cells."""
        kept = np.flatnonzero([not cell.is_speck for cell in draft.cells])
        return lower_bound_m(
            [draft.cells[i] for i in kept],
            self.settings.shape,
            draft.cell_m,
            draft.network.around.among(kept),
        )

    def _outcome(
        self,
        draft: Draft,
        stops: list[Stop],
        targets: tuple[Target, ...],
        bound_m: float | None,
    ) -> PlanOutcome:
        points = _through_centres(draft.start, stops)
        first = next(i for i, stop in enumerate(stops) if stop.cell is not None)
        last = max(i for i, stop in enumerate(stops) if stop.cell is not None)
        within = points[first + 1 : last + 2]
        bound = self.bound_m(draft) if bound_m is None else bound_m
        length = _length(within)
        path = self._path_through(draft, targets)
        return PlanOutcome(
            cell_m=draft.cell_m,
            angle_deg=draft.angle_deg,
            length_m=_length(points),
            turns=_turns(points),
            time_s=self.travel.path_s(path),
            energy_wh=self.travel.path_wh(path),
            lower_bound_m=bound,
            gap=length / bound - 1 if bound > 0 else 0.0,
            method=draft.route.method,
        )


def _through_centres(start: tuple[float, float], stops: list[Stop]) -> NDArray[np.float64]:
    cells = [stop.cell is not None for stop in stops]
    return taut_path(start, [stop.footprint for stop in stops], centred=cells)


def _length(points: NDArray[np.float64]) -> float:
    return float(np.sum(np.hypot(*np.diff(points, axis=0).T)))


def _turns(points: NDArray[np.float64]) -> int:
    steps = np.diff(points, axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-9]
    bearing = np.arctan2(steps[:, 1], steps[:, 0])
    turned = np.abs((np.diff(bearing) + math.pi) % (2 * math.pi) - math.pi)
    return int(np.sum(turned > TURN_RAD))


def _south_west(water: shapely.Polygon) -> tuple[float, float]:
    north, east = min(water.exterior.coords[:-1], key=lambda corner: corner[0] + corner[1])[:2]
    return north, east


def _long_side_deg(water: shapely.Polygon) -> float:
    """Direction of the longer side of the smallest rectangle around the water, in [0, 180)."""
    ring = shapely.get_coordinates(shapely.oriented_envelope(water))
    sides = np.diff(ring[:3], axis=0)
    north, east = sides[int(np.argmax(np.hypot(*sides.T)))]
    return math.degrees(math.atan2(east, north)) % 180.0
