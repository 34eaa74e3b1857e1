"""The settings and the outcome of a plan; the survey stores both in full."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError, UsageError
from grebe.core.vessel import Vessel

Shape = Literal["square", "hexagon", "triangle"]
Pattern = Literal["free", "rows", "columns"]
SHAPES: tuple[Shape, ...] = get_args(Shape)
PATTERNS: tuple[Pattern, ...] = get_args(Pattern)

# A window whose lower end exceeds this share of the top speed leaves no thrust to steer with.
SPEED_RESERVE = 0.9
MOST_BOATS = 50
# A target must stay large enough to be entered by more than the controller's margin.
SMALLEST_CORE = 0.2


@dataclass(frozen=True, kw_only=True)
class SortieSettings:
    """Limits of one sortie: the battery's energy [Wh], the time [min], or both.

    `reserve` is the share of either that must be left when the boat is back. `harbours` are
    the places (longitude, latitude) at which it can be launched and taken out again, by default
    the survey's start. `batteries_wh` and `minutes_each` give each boat of a fleet its own limit,
    in order, in place of the common one.
    """

    battery_wh: float | None = None
    minutes: float | None = None
    reserve: float = 0.2
    harbours: tuple[tuple[float, float], ...] = ()
    batteries_wh: tuple[float, ...] = ()
    minutes_each: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        one, each = (self.battery_wh, self.minutes), (self.batteries_wh, self.minutes_each)
        if one == (None, None) and not any(each):
            raise UsageError(
                "A sortie needs a limit; give the battery's watt-hours or the minutes.",
                settings=("sortie_battery_wh", "sortie_minutes"),
            )
        if any(all_ is not None and own for all_, own in zip(one, each, strict=True)):
            raise UsageError(
                "Limits are given both for all boats and for each boat; give only one of the two.",
                settings=("sortie_battery_wh", "sortie_minutes"),
            )
        for given in (*one, *self.batteries_wh, *self.minutes_each):
            if given is not None and not 0 < given < math.inf:
                raise UsageError(
                    f"A sortie's limit of {given:g} Wh or minutes is impossible; give a positive "
                    "number.",
                    settings=("sortie_battery_wh", "sortie_minutes"),
                )
        if not 0 <= self.reserve < 1:
            raise UsageError(
                f"A reserve of {self.reserve:g} is impossible; give a share from 0 to less than 1.",
                settings=("reserve",),
            )

    @property
    def are_unlike(self) -> bool:
        """Whether each boat of a fleet has its own battery or minutes."""
        return bool(self.batteries_wh or self.minutes_each)

    def of_boat(self, boat: int) -> SortieSettings:
        """Limits of a sortie of boat number `boat`, from 1."""
        return replace(
            self,
            battery_wh=self.batteries_wh[boat - 1] if self.batteries_wh else self.battery_wh,
            minutes=self.minutes_each[boat - 1] if self.minutes_each else self.minutes,
            batteries_wh=(),
            minutes_each=(),
        )


@dataclass(frozen=True, kw_only=True)
class FleetSettings:
    """Number of boats that share a survey, and the distance they keep [m], centre to centre.

    `starts` are the places (longitude, latitude) at which they are launched, one for each boat;
    by default each is launched where its part begins. `vessels` are their hulls, one for each
    boat; by default all have the survey's.
    """

    boats: int
    apart_m: float = 8.0
    starts: tuple[tuple[float, float], ...] = ()
    vessels: tuple[Vessel, ...] = ()

    def __post_init__(self) -> None:
        if not 2 <= self.boats <= MOST_BOATS:
            raise UsageError(
                f"A fleet has 2 to {MOST_BOATS} boats, not {self.boats}.", settings=("boats",)
            )
        if not 0 < self.apart_m < math.inf:
            raise UsageError(
                f"A distance of {self.apart_m:g} m between boats is impossible; give a positive "
                "number of metres.",
                settings=("apart_m",),
            )
        if self.starts and len(self.starts) != self.boats:
            raise UsageError(
                f"{self.boats} boats need {self.boats} starts, not {len(self.starts)}.",
                settings=("starts", "boats"),
            )
        if self.vessels and len(self.vessels) != self.boats:
            raise UsageError(
                f"{self.boats} boats need one vessel for all or {self.boats} vessels, not "
                f"{len(self.vessels)}.",
                settings=("vessel", "boats"),
            )

    def vessel(self, boat: int) -> Vessel | None:
        """Vessel of boat number `boat`, from 1; None if it is the survey's."""
        return self.vessels[boat - 1] if self.vessels else None


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """Settings of a plan.

    `cell_m` is the side of a square of the cells' area, whatever their `shape`; None with a
    budget of `minutes` or `energy_wh`. `core` is the share of its cell to which a target is shrunk
    about the middle: less than 1 keeps the boat from cutting the cells' corners. `angle_deg` is the
    direction of the rows (None: the planner looks for the best one). `returns`: the survey includes
    the return to the start. `weather` is the weather that the plan assumes.
    `coast_tolerance_m`: a coast of very many vertices may be simplified by this much, always on
    the water's side (0: never; None: by the cells' size). `sorties`: the survey is cut into trips
    from a harbour and back; None if it is one mission. `fleet`: several boats share it; None for
    one.
    """

    cell_m: float | None = 5.0
    shape: Shape = "square"
    core: float = 1.0
    pattern: Pattern = "free"
    angle_deg: float | None = 0.0
    speed_min_mps: float = 1.0
    speed_max_mps: float = 2.0
    shore_margin_m: float = 0.0
    coast_tolerance_m: float | None = None
    returns: bool = False
    weather: Weather = CALM
    minutes: float | None = None
    energy_wh: float | None = None
    sorties: SortieSettings | None = None
    fleet: FleetSettings | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.speed_min_mps < self.speed_max_mps:
            raise UsageError(
                f"The speed window {self.speed_min_mps:g}:{self.speed_max_mps:g} m/s is empty or "
                "negative; give 0 <= lower end < upper end.",
                settings=("speed",),
            )
        if self.cell_m is not None and not 0 < self.cell_m < math.inf:
            raise UsageError(
                f"A cell of {self.cell_m:g} m is impossible; give a positive number of metres.",
                settings=("cell_m",),
            )
        if self.shape not in SHAPES:
            raise UsageError(
                f"There is no cell shape {self.shape!r}; choose {', '.join(SHAPES)}.",
                settings=("shape",),
            )
        if self.pattern not in PATTERNS:
            raise UsageError(
                f"There is no pattern {self.pattern!r}; choose {', '.join(PATTERNS)}.",
                settings=("pattern",),
            )
        if not SMALLEST_CORE <= self.core <= 1:
            raise UsageError(
                f"A core of {self.core:g} is impossible; give a share of the cell "
                f"from {SMALLEST_CORE:g} to 1.",
                settings=("core",),
            )
        if not 0 <= self.shore_margin_m < math.inf:
            raise UsageError(
                f"A shore margin of {self.shore_margin_m} m is impossible; give 0 or more.",
                settings=("shore_margin_m",),
            )
        tolerance = self.coast_tolerance_m
        if tolerance is not None and not 0 <= tolerance < math.inf:
            raise UsageError(
                f"A coast tolerance of {tolerance} m is not possible; give 0 or more.",
                settings=("coast_tolerance_m",),
            )
        budgets = [b for b in (self.minutes, self.energy_wh) if b is not None]
        if len(budgets) + (self.cell_m is not None) != 1:
            raise UsageError(
                "Give exactly one of: the cells' size, the minutes, the watt-hours.",
                settings=("cell_m", "minutes", "energy_wh"),
            )
        if budgets and not 0 < budgets[0] < math.inf:
            raise UsageError(
                f"A budget of {budgets[0]} is impossible; give a positive number.",
                settings=("minutes", "energy_wh"),
            )
        _check_one_each(self.sorties, self.fleet)

    def of_boat(self, boat: int) -> PlanSettings:
        """These settings with the battery and the minutes of boat number `boat`, from 1."""
        if self.sorties is None or not self.sorties.are_unlike:
            return self
        return replace(self, sorties=self.sorties.of_boat(boat))


def _check_one_each(sorties: SortieSettings | None, fleet: FleetSettings | None) -> None:
    """Raise `UsageError` unless individual batteries or minutes are given for every boat."""
    if sorties is None:
        return
    boats = 1 if fleet is None else fleet.boats
    for several, what, setting in (
        (sorties.batteries_wh, "battery", "sortie_battery_wh"),
        (sorties.minutes_each, "number of minutes", "sortie_minutes"),
    ):
        if several and len(several) != boats:
            many = f"Give one {what} for all {boats} boats, or {boats}"
            raise UsageError(
                f"{'One boat takes one ' + what if boats == 1 else many}, not {len(several)}.",
                settings=(setting, "boats"),
            )


@dataclass(frozen=True, kw_only=True)
class PlanOutcome:
    """Results of the planner; `gap` is length over lower bound, less one.

    `cell_m` and `angle_deg` are as given or chosen. Length and turns are those of the shortest
    path through the centres of all cells by way of the transits. Time and energy are those of the
    shortest (taut) path, which a boat follows if it only has to enter each target. `method` names
    the method that made the order.
    """

    cell_m: float
    angle_deg: float
    length_m: float
    turns: int
    time_s: float
    energy_wh: float
    lower_bound_m: float
    gap: float
    method: str


def check_speed(settings: PlanSettings, vessel: Vessel) -> None:
    """Raise `PlanError` if the vessel cannot hold the speed window."""
    if settings.speed_min_mps > SPEED_RESERVE * vessel.speed_max_mps:
        raise PlanError(
            f"The speed window {settings.speed_min_mps:g}:{settings.speed_max_mps:g} m/s is too "
            f"fast for vessel {vessel.name!r}, which makes {vessel.speed_max_mps:.2f} m/s at "
            "full thrust; its lower end must be below "
            f"{SPEED_RESERVE * vessel.speed_max_mps:.2f}.",
            settings=("speed",),
        )
