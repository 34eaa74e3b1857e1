"""The safety states of a boat, and the causes of its changes from one state to another.

Every change is an event with the cause's code. docs/safety.md has a row for each cause.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from grebe.core.dynamics import Weather
from grebe.core.events import EndReason, State

Place = tuple[float, float]


class SafetyState(enum.Enum):
    """What the boat does: it surveys, returns home, holds its position, frees itself by going
    astern, or is stopped for good.
    """

    SURVEYING = "surveying"
    RETURNING = "returning"
    HOLDING = "holding"
    FREEING = "freeing"
    STOPPED = "stopped"


class Cause(enum.Enum):
    """Why a state changes; the value is the code of the change's entry in the log."""

    FENCE = "fence_near"
    INSIDE_AGAIN = "inside_again"
    BATTERY = "battery_low"
    TIME = "time_short"
    DAYLIGHT = "daylight_short"
    COME_HOME = "asked_to_come_home"
    HOLD = "asked_to_hold"
    GO_ON = "asked_to_go_on"
    HOME = "home_reached"
    NO_WAY_HOME = "no_way_home"
    BLIND = "no_estimates"
    SEES = "estimates_again"
    WEEDS = "thrust_without_motion"
    SHALLOW = "water_too_shallow"
    FREE = "astern_again_free"
    THRUSTER = "thruster_without_effect"
    CURRENT = "current_too_strong"
    TRAFFIC = "another_boat_near"
    CLEAR = "way_is_clear"
    UNMEASURED = "nothing_measured"
    MEASURES = "measured_again"


# The end of a mission that is stopped for a cause.
ENDS: dict[Cause, EndReason] = {
    Cause.FENCE: EndReason.FENCE_NOT_KEPT,
    Cause.HOME: EndReason.CAME_HOME,
    Cause.NO_WAY_HOME: EndReason.HOME_NOT_REACHED,
    Cause.BLIND: EndReason.BLIND,
    Cause.WEEDS: EndReason.STUCK,
    Cause.SHALLOW: EndReason.GROUNDED,
    Cause.THRUSTER: EndReason.THRUSTER_DEAD,
    Cause.CURRENT: EndReason.CURRENT_TOO_STRONG,
    Cause.TRAFFIC: EndReason.TARGET_GIVEN_UP,
}


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What is known at an estimate.

    `time_s` counts from the opening of the link, `elapsed_s` from the mission's first estimate.
    `state` (6,) and `weather` are estimates, and `thrusts` [N] led to this state. `reached` counts
    the survey's targets. `home_s` is the predicted time home: infinite if no route is known, and
    None if it is not needed. `battery_share`, `depth_m` and `used_wh` are given if they are known.
    `light_s` is the daylight left [s]. `outside`: the boat is outside its fence. The instrument
    named `mute` has been silent for `mute_s`.
    """

    time_s: float
    elapsed_s: float
    state: State
    weather: Weather
    thrusts: tuple[float, float] = (0.0, 0.0)
    reached: int = 0
    home_s: float | None = None
    home_wh: float = 0.0
    at_home: bool = False
    home_given_up: bool = False
    battery_share: float | None = None
    used_wh: float = 0.0
    depth_m: float | None = None
    light_s: float = math.inf
    outside: bool = False
    mute: str = ""
    mute_s: float = 0.0

    @property
    def place(self) -> Place:
        """Where the boat is (north, east) [m]."""
        return self.state[0], self.state[1]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something found out about the boat: the cause, and a sentence."""

    cause: Cause
    message: str
