"""A stand-in for a boat's autopilot: modes, an inner loop and fail-safes, over a simulated hull.

Where a survey depends on it, it behaves as measured on ArduRover 4.x. Commands of speed and yaw
rate are followed only in GUIDED, clamped to WP_SPEED, and dropped after three seconds of silence;
sticks are followed in MANUAL. The position is good only some time after the start. A breach of the
fence, a lost position and an empty battery make the autopilot hold. It does not speak MAVLink:
`grebe.links.mavlink.standin` adds that.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

import numpy as np
import shapely

from grebe.core.errors import UsageError
from grebe.core.inner_loop import yaw_rate_max_radps
from grebe.core.vessel import Vessel
from grebe.simulation.plant import Plant

STEP_S = 0.02
# Time constants of the inner loops [s], and the share of the error that is integrated each second.
SPEED_LOOP_S, YAW_LOOP_S, INTEGRAL_PER_S = 0.8, 0.3, 0.4


class Mode(enum.IntEnum):
    """The ArduRover modes used here, by their MAVLink numbers."""

    MANUAL = 0
    HOLD = 4
    LOITER = 5
    AUTO = 10
    RTL = 11
    GUIDED = 15
    INITIALISING = 16


@dataclass(frozen=True, kw_only=True)
class Upsets:
    """What befalls the autopilot, and when, in seconds since the start; infinity is never.

    `gps_lost`: begin and end of a time without a fix. `stuck_in_hold`: every other mode is refused.
    `pilot_takes_at`: the pilot switches to MANUAL. `reboots_at`: the autopilot restarts.
    `battery_empty_at`: its battery fail-safe acts.
    """

    gps_lost: tuple[float, float] = (math.inf, math.inf)
    stuck_in_hold: bool = False
    pilot_takes_at: float = math.inf
    reboots_at: float = math.inf
    battery_empty_at: float = math.inf


NO_UPSETS = Upsets()


@dataclass(frozen=True, kw_only=True)
class AutopilotSettings:
    """The stand-in's parameters, in SI units.

    `ready_s`: time from a start until the position is good. `blind_s`: time for which the position
    stays good without a fix. `fence`: in local metres (north, east), None for none. The errors of
    the estimates are standard deviations.
    """

    speed_max_mps: float = 2.0
    accel_max_mps2: float = 1.0
    timeout_s: float = 3.0
    ready_s: float = 38.0
    blind_s: float = 5.0
    fence: shapely.Polygon | None = None
    battery_s: float = 4 * 3600.0
    position_error_m: float = 0.05
    heading_error_rad: float = 0.005
    velocity_error_mps: float = 0.02
    seed: int = 0

    def __post_init__(self) -> None:
        positive = (self.speed_max_mps, self.accel_max_mps2, self.timeout_s, self.battery_s)
        if not min(positive) > 0:
            raise UsageError(
                "The stand-in's speed, acceleration, time-out and battery must be above 0."
            )


@dataclass
class _Asked:
    """The last order and its time."""

    at_s: float = -math.inf
    surge_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    sticks: tuple[float, float] = (0.0, 0.0)


@dataclass
class Autopilot:
    """A boat with an autopilot; only `advance` takes simulated time.

    `time_s` counts from the creation of the stand-in, `boot_s` from the autopilot's last start.
    """

    plant: Plant
    settings: AutopilotSettings = field(default_factory=AutopilotSettings)
    faults: Upsets = NO_UPSETS
    mode: Mode = Mode.HOLD
    armed: bool = False
    time_s: float = 0.0
    started_s: float = 0.0
    texts: list[str] = field(default_factory=list[str])

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.settings.seed)
        self._asked = _Asked()
        self._speed_target = 0.0
        self._integral = self._turn_integral = 0.0
        self._fix_s = 0.0
        self._drift = np.zeros(2)
        self._breached = False
        self._rebooted = self._taken = False

    @property
    def boot_s(self) -> float:
        """Time since the autopilot started [s]."""
        return self.time_s - self.started_s

    @property
    def has_fix(self) -> bool:
        """Whether the receiver has a fix."""
        lost, found = self.faults.gps_lost
        return not lost <= self.time_s < found

    @property
    def knows_position(self) -> bool:
        """Whether the filter's flag for an absolute horizontal position is set."""
        return (
            self.boot_s >= self.settings.ready_s
            and self.time_s - self._fix_s < self.settings.blind_s
        )

    @property
    def battery_share(self) -> float:
        """Remaining share of the battery, 0 to 1."""
        return max(0.0, 1.0 - self.time_s / self.settings.battery_s)

    @property
    def breached(self) -> bool:
        """Whether the boat is outside the fence."""
        return self._breached

    def arm(self, *, arms: bool) -> str:
        """Arm or disarm; return the reason for a refusal, or an empty text."""
        if arms and not self.knows_position:
            return "PreArm: waiting for the position"
        self.armed = arms
        return ""

    def set_mode(self, number: int) -> bool:
        """Change the mode, as requested by a ground station; return whether it was accepted."""
        if number not in set(Mode) or number == Mode.INITIALISING:
            return False
        mode = Mode(number)
        needs_position = mode in (Mode.GUIDED, Mode.LOITER, Mode.RTL, Mode.AUTO)
        if self.faults.stuck_in_hold or (needs_position and not self.knows_position):
            return mode is self.mode
        self._enter(mode)
        return True

    def follow(self, surge_mps: float, yaw_rate_radps: float) -> None:
        """Take a command of speed and yaw rate, which is followed only in GUIDED."""
        limit = self.settings.speed_max_mps
        self._asked = _Asked(
            at_s=self.time_s,
            surge_mps=min(max(surge_mps, -limit), limit),
            yaw_rate_radps=yaw_rate_radps,
        )

    def take_sticks(self, steering: float, throttle: float) -> None:
        """Take the sticks' positions, -1 to 1, which are followed only in MANUAL."""
        self._asked = _Asked(at_s=self.time_s, sticks=(steering, throttle))

    def estimate(self) -> tuple[float, ...]:
        """The filter's estimate of the state (6,), with random errors."""
        s = self.settings
        scale = [s.position_error_m] * 2 + [s.heading_error_rad] + [s.velocity_error_mps] * 3
        errors = self._random.normal(size=6) * scale
        errors[:2] += self._drift
        return tuple((np.array(self.plant.state) + errors).tolist())

    def advance(self, duration_s: float) -> None:
        """Advance the simulation, in steps of `STEP_S`."""
        for _ in range(max(1, round(duration_s / STEP_S))):
            self._events()
            self.plant.command(self._thrusts())
            self.plant.advance(STEP_S)
            self.time_s += STEP_S

    def _enter(self, mode: Mode, why: str = "") -> None:
        if mode is not self.mode and why:
            self.texts.append(why)
        self.mode = mode
        self._integral = self._turn_integral = 0.0
        self._speed_target = self.plant.state[3]
        self._asked = _Asked()

    def _events(self) -> None:
        """Apply the faults that are due, and the fail-safes that respond to them."""
        if self.time_s >= self.faults.reboots_at and not self._rebooted:
            self._rebooted = True
            self.started_s, self.armed = self.time_s, False
            self._enter(Mode.HOLD)
        if self.time_s >= self.faults.pilot_takes_at and not self._taken:
            self._taken = True
            self._enter(Mode.MANUAL)
        self._watch_position()
        self._watch_fence()
        empty = self.battery_share <= 0 or self.time_s >= self.faults.battery_empty_at
        if empty and self.armed and self.mode is not Mode.HOLD:
            self._enter(Mode.HOLD, "Battery failsafe")

    def _watch_position(self) -> None:
        if self.has_fix:
            self._fix_s = self.time_s
            self._drift = np.zeros(2)
            return
        self._drift = self._drift + self._random.normal(size=2) * 0.05 * math.sqrt(STEP_S)
        if not self.knows_position and self.mode in (Mode.GUIDED, Mode.LOITER, Mode.RTL):
            self._enter(Mode.HOLD, "EKF failsafe")

    def _watch_fence(self) -> None:
        fence = self.settings.fence
        if fence is None:
            return
        north, east = self.plant.state[:2]
        outside = not shapely.intersects_xy(fence, north, east)
        if outside and not self._breached and self.armed:
            self._enter(Mode.HOLD, "Fence breached")
        self._breached = outside

    def _thrusts(self) -> tuple[float, float]:
        vessel = self.plant.vessel
        silent = self.time_s - self._asked.at_s > self.settings.timeout_s
        if not self.armed or self.mode in (Mode.HOLD, Mode.INITIALISING):
            return 0.0, 0.0
        if self.mode is Mode.MANUAL:
            steering, throttle = (0.0, 0.0) if silent else self._asked.sticks
            full = vessel.thrust_max_n
            return full * (throttle + steering), full * (throttle - steering)
        if self.mode is Mode.GUIDED and not silent:
            return self._held(self._asked.surge_mps, self._asked.yaw_rate_radps)
        return self._held(0.0, 0.0)

    def _held(self, surge_mps: float, yaw_rate_radps: float) -> tuple[float, float]:
        """Thrusts of the two inner loops; turning has priority over speed."""
        vessel = self.plant.vessel
        _, _, _, surge, _, yaw_rate = self.plant.state
        ramp = self.settings.accel_max_mps2 * STEP_S
        self._speed_target += min(max(surge_mps - self._speed_target, -ramp), ramp)
        error = self._speed_target - surge
        push = vessel.surge_drag_n(self._speed_target) + self._integral
        push += vessel.m11_kg / SPEED_LOOP_S * error
        limit = yaw_rate_max_radps(vessel)
        wanted = min(max(yaw_rate_radps, -limit), limit)
        moment = -(vessel.n_r + vessel.n_rr * abs(wanted)) * wanted
        stiffness = vessel.m33_kgm2 / YAW_LOOP_S
        moment += stiffness * (wanted - yaw_rate) + self._turn_integral
        if abs(moment) < vessel.arm_m * (vessel.thrust_max_n - vessel.thrust_min_n):
            self._turn_integral += INTEGRAL_PER_S * stiffness * (wanted - yaw_rate) * STEP_S
        low, high = 2 * vessel.thrust_min_n, 2 * vessel.thrust_max_n
        if low < push < high:
            self._integral += INTEGRAL_PER_S * vessel.m11_kg / SPEED_LOOP_S * error * STEP_S
        return _allocated(vessel, push, moment)


def _allocated(vessel: Vessel, push_n: float, moment_nm: float) -> tuple[float, float]:
    """Thrusts of port and starboard for a push and a moment; the moment has priority."""
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    half = min(max(moment_nm / (2 * vessel.arm_m), -(high - low) / 2), (high - low) / 2)
    middle = min(max(push_n / 2, low + abs(half)), high - abs(half))
    return middle + half, middle - half
