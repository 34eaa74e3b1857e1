"""The survey: the targets to visit, their order, and the boat that visits them.

`Survey` is the plan that every other part reads. Its records are plain and frozen, with positions
in the survey's local frame; the survey file converts them to WGS 84.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings, PlanOutcome, PlanSettings
from grebe.core.sets import TargetSet
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

TargetKind = Literal["cell", "transit"]
# A survey file's note on its outline, if that is the hull of a track and not a shore.
OF_TRACK = "convex hull of the track"
# First word of a survey file's note on its water, if the samples are simulated.
SIMULATED_WATER = "simulated"


def is_simulated(water: str) -> bool:
    """Return whether a survey file's note on its water says that the samples are simulated.

    The second test recognises the note that earlier versions wrote for a fleet.
    """
    return water.startswith(SIMULATED_WATER) or water.endswith("boats: sim:")


@dataclass(frozen=True, kw_only=True)
class Target:
    """One set of the ordered sequence Omega_1 ... Omega_K; `seq` is its number in the survey.

    A plan numbers its targets from 1 in their order; they keep their numbers in later orders
    (`grebe.core.revision`).

    `cell` is the piece of water that the target represents, None for a transit. It equals the
    target's footprint, or is larger if the target was shrunk towards the middle of its cell.
    """

    seq: int
    kind: TargetKind
    set: TargetSet
    cell: shapely.Polygon | None = None


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Starting position [m] of a boat in the local frame, and its heading [rad]."""

    north_m: float
    east_m: float
    heading_rad: float = 0.0

    def at_rest(self) -> tuple[float, float, float, float, float, float]:
        """Return the state z of a boat at rest in this pose."""
        return self.north_m, self.east_m, self.heading_rad, 0.0, 0.0, 0.0


@dataclass(frozen=True, kw_only=True)
class Survey:
    """A region of water and the targets in it, in the order in which they are visited.

    `water` is a local polygon (x north, y east). A survey that was imported from a track
    has no targets, no vessel and no start. `corridors`, if not empty, holds for each target the
    convex polygon to stay in on the way to it. `settings` and `outcome` are the plan's settings
    and the planner's results. Raises `InputError` if targets are not numbered uniquely from 1 on,
    if a corridor is missing, or if `water` is empty or invalid.
    """

    name: str
    frame: LocalFrame
    water: shapely.Polygon
    no_go: tuple[shapely.Polygon, ...] = ()
    targets: tuple[Target, ...] = ()
    corridors: tuple[shapely.Polygon, ...] = ()
    vessel: Vessel | None = None
    start: Pose | None = None
    settings: PlanSettings | None = None
    outcome: PlanOutcome | None = None

    def __post_init__(self) -> None:
        numbers = {target.seq for target in self.targets}
        if len(numbers) != len(self.targets) or min(numbers, default=1) < 1:
            raise InputError("Each of the survey's targets needs a number of its own, from 1 on.")
        if self.corridors and len(self.corridors) != len(self.targets):
            raise InputError("The survey has corridors for some of its targets, but not for all.")
        if self.water.is_empty or not self.water.is_valid:
            raise InputError("The survey's water is not a valid polygon.")

    def vessel_of(self, boat: int) -> Vessel | None:
        """Vessel of boat number `boat` of the fleet, from 1: its own, or else the survey's."""
        return (self.fleet and self.fleet.vessel(boat)) or self.vessel

    def whose(self, boat: int) -> str:
        """Name of a fleet's boat for messages, with its vessel if they differ; "" for one boat."""
        if self.fleet is None:
            return ""
        vessel = self.fleet.vessel(boat)
        return f"boat {boat}" if vessel is None else f"boat {boat} ({vessel.name})"

    @property
    def fleet(self) -> FleetSettings | None:
        """Fleet that the survey was planned for; None for one boat."""
        return None if self.settings is None else self.settings.fleet

    @property
    def sets(self) -> list[TargetSet]:
        """The target sets Omega_1 ... Omega_K."""
        return [target.set for target in self.targets]

    @property
    def cells(self) -> NDArray[np.object_]:
        """Cells that the targets represent."""
        return np.array([t.cell for t in self.targets if t.cell is not None], dtype=object)

    @property
    def coverage(self) -> float:
        """Share of the water that the cells cover, 0 to 1."""
        cells = self.cells
        return covered_share(cells, self.water, overlap_m2(cells))


def overlap_m2(cells: NDArray[np.object_]) -> float:
    """Return the total area [m2] of the overlaps between pairs of cells.

    A cell whose edges match those of its neighbours, corner for corner, overlaps none; only the
    others are tested.
    """
    doubtful = np.flatnonzero(~shapely.is_empty(shapely.coverage_invalid_edges(cells)))
    place, second = shapely.STRtree(cells).query(cells[doubtful], predicate="intersects")
    first = doubtful[place]
    # A pair of doubtful cells is found from either side; count it once.
    once = (first < second) | ((first > second) & ~np.isin(second, doubtful))
    shared = shapely.intersection(cells[first[once]], cells[second[once]], grid_size=1e-6)
    return float(shapely.area(shared).sum())


def covered_share(cells: NDArray[np.object_], water: shapely.Polygon, overlap_m2: float) -> float:
    """Return the share of the water that cells cover, 0 to 1; overlaps count once."""
    shapely.prepare(water)
    inside = shapely.covers(water, cells)
    beyond = shapely.intersection(cells[~inside], water, grid_size=1e-6)
    covered = shapely.area(cells[inside]).sum() + shapely.area(beyond).sum() - overlap_m2
    return min(1.0, float(covered / water.area))
