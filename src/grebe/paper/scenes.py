"""The scenes of the paper's figures: sets, starts, settings.

The paper prints the starts of Figs. 2 and 7, N = 15, T = 1 s, the size of the cells and the
windows of Figs. 8 and 9. It prints no coordinates of the sets of Figs. 1 and 2, nor of the region
of Fig. 7. Those used here are stand-ins that show the same effects. The boat is the illustrative
`spyboat`, because the SPYBOAT's own parameters are not public. The last row of Eq. (9) has
Fossen's sign unless another boat is given (`grebe.core.vessel.with_printed_sign`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import shapely

from grebe.control.controller import Controller
from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.solvers.base import SolverBuilder
from grebe.control.solvers.builders import Fatrop
from grebe.core.sets import TargetSet, rectangle, ring_vertices
from grebe.core.vessel import Vessel, vessel_named
from grebe.mission.trial import Conditions, Trial, simulate
from grebe.planning.cells.mesh import mesh_water, target_footprint
from grebe.planning.paths.network import connect
from grebe.planning.route.orders import sweeps

State = tuple[float, float, float, float, float, float]

WINDOW_1_2 = (1.0, 2.0)
WINDOW_HALF = (0.5, 1.5)
# Side of the cells of Fig. 7 [m], which have 25 m2.
CELL_M = 5.0
LIMIT_S = 1500.0
BOAT = vessel_named("spyboat")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything on which the track of a figure depends."""

    targets: tuple[TargetSet, ...]
    start: State
    rule: Rule
    solver: SolverBuilder
    vessel: Vessel

    def sailed(self) -> Trial:
        """Sail the scene in still water."""
        pilot = Controller(self.vessel, self.targets, self.rule, solver=self.solver)
        return simulate(self.vessel, self.targets, pilot, self.start, Conditions(limit_s=LIMIT_S))


def _scene(targets: tuple[TargetSet, ...], start: State, boat: Vessel) -> Scene:
    return Scene(
        targets=targets,
        start=start,
        # FATROP to its full tolerance: mirror images must agree to the millimetre.
        solver=Fatrop(),
        rule=Dual(),
        vessel=boat,
    )


def sailed_with(scene: Scene, rule: Rule, solver: SolverBuilder) -> Scene:
    """Return the scene with another rule and solver."""
    return replace(scene, rule=rule, solver=solver)


def mirrored_paths(boat: Vessel = BOAT) -> tuple[Scene, Scene]:
    """Fig. 1: two paths of five sets, reflections of each other across the line of approach."""
    middles = [(22.0, 0.0), (30.0, 7.0), (32.0, 16.0), (26.0, 23.0), (17.0, 25.0)]

    def path(side: float) -> tuple[TargetSet, ...]:
        return tuple(
            rectangle((n - 2, n + 2), (side * e - 2, side * e + 2), WINDOW_1_2) for n, e in middles
        )

    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return _scene(path(1.0), start, boat), _scene(path(-1.0), start, boat)


def four_sets(boat: Vessel = BOAT) -> Scene:
    """Fig. 2: from (0, 0, pi/2, 0, 0, 0) through four sets. The third is off the shortest path from
    the second to the fourth, so touching its rim is enough.
    """
    targets = (
        rectangle((-2.0, 2.0), (10.0, 14.0), WINDOW_1_2),
        rectangle((4.0, 8.0), (20.0, 24.0), WINDOW_1_2),
        rectangle((9.0, 13.0), (30.0, 34.0), WINDOW_1_2),
        rectangle((4.0, 8.0), (40.0, 44.0), WINDOW_1_2),
    )
    return _scene(targets, (0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0), boat)


def region() -> shapely.Polygon:
    """The stand-in for the region of Fig. 7: convex, x north and y east [m]."""
    return shapely.Polygon([(5, 100), (30, 105), (55, 85), (60, 45), (45, 15), (20, 5), (0, 30)])


def exploration(window: tuple[float, float] = WINDOW_1_2, boat: Vessel = BOAT) -> Scene:
    """Figs. 7 to 9: squares of 25 m2 over the region, back and forth, from (20, 105, -pi/2).

    The edge of the region cuts some squares, and some consecutive ones share only a corner, because
    the region is not the paper's.
    """
    start = (20.0, 105.0, -math.pi / 2, 0.0, 0.0, 0.0)
    connected_mesh = mesh_water(region(), CELL_M)
    order, _ = sweeps(connected_mesh, connect(connected_mesh, region(), CELL_M), start[:2])
    cells = [connected_mesh[i] for i in order]
    targets = tuple(
        TargetSet(
            vertices=target_footprint(ring_vertices(cell.footprint)),
            speed_min_mps=window[0],
            speed_max_mps=window[1],
        )
        for cell in cells
    )
    return _scene(targets, start, boat)
