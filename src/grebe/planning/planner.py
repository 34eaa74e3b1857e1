"""From a region to a survey: mesh, order, targets, start, and the checks between."""

from __future__ import annotations

import math
from dataclasses import dataclass

import shapely

from grebe.errors import PlanError
from grebe.planning.mesh import mesh_squares, target_footprint
from grebe.planning.region import Region, convex_water
from grebe.planning.route import boustrophedon
from grebe.sets import TargetSet
from grebe.survey import Pose, Survey, Target
from grebe.vessel import Vessel

# A window whose lower end needs more than this share of the top speed leaves no thrust to
# steer with.
SPEED_RESERVE = 0.9
FARTHEST_START_M = 5000.0


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """What a plan is made with: side of the cells, direction of the rows, speed window."""

    cell_m: float = 5.0
    angle_deg: float = 0.0
    speed_min_mps: float = 1.0
    speed_max_mps: float = 2.0

    def __post_init__(self) -> None:
        if not 0 <= self.speed_min_mps < self.speed_max_mps:
            raise PlanError(
                f"The speed window {self.speed_min_mps:g}:{self.speed_max_mps:g} m/s is empty or "
                "negative; give LO:HI with 0 <= LO < HI."
            )


def plan_survey(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
) -> Survey:
    """Plan a survey of convex water; `PlanError` says why there is none.

    Without a start the boat begins at the south-western corner of the region's bounds'
    nearest water.
    """
    water = convex_water(region)
    check_speed(settings, vessel)
    cells = mesh_squares(water, settings.cell_m, settings.angle_deg)
    position = _start_position(region, start_lonlat)
    ordered = boustrophedon(cells, position)
    targets = tuple(
        Target(
            seq=i + 1,
            kind="cell",
            set=TargetSet(
                vertices=target_footprint(cell.footprint),
                speed_min_mps=settings.speed_min_mps,
                speed_max_mps=settings.speed_max_mps,
            ),
        )
        for i, cell in enumerate(ordered)
    )
    north, east = targets[0].set.centre
    heading = math.atan2(east - position[1], north - position[0])
    return Survey(
        name=region.name,
        frame=region.frame,
        water=water,
        targets=targets,
        vessel=vessel,
        start=Pose(north_m=position[0], east_m=position[1], heading_rad=heading),
        settings={
            "cell_m": settings.cell_m,
            "angle_deg": settings.angle_deg,
            "speed_min_mps": settings.speed_min_mps,
            "speed_max_mps": settings.speed_max_mps,
        },
    )


def check_speed(settings: PlanSettings, vessel: Vessel) -> None:
    """Refuse a speed window that the vessel cannot hold."""
    if settings.speed_min_mps > SPEED_RESERVE * vessel.speed_max_mps:
        raise PlanError(
            f"The speed window {settings.speed_min_mps:g}:{settings.speed_max_mps:g} m/s is beyond "
            f"the reach of vessel {vessel.name!r}, which makes {vessel.speed_max_mps:.2f} m/s at "
            f"full thrust; its lower end must be below {SPEED_RESERVE * vessel.speed_max_mps:.2f}."
        )


def _start_position(region: Region, lonlat: tuple[float, float] | None) -> tuple[float, float]:
    if lonlat is None:
        corners = region.water.exterior.coords[:-1]
        north, east = min(corners, key=lambda corner: corner[0] + corner[1])[:2]
        return north, east
    north, east = region.frame.to_local(lonlat).tolist()
    away = region.water.distance(shapely.Point(north, east))
    if not away <= FARTHEST_START_M:
        raise PlanError(
            f"The start {lonlat[0]:g},{lonlat[1]:g} lies {away / 1000:.1f} km from the region; "
            "give LON,LAT in degrees, longitude first."
        )
    return north, east
