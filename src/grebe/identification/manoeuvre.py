"""A short drive for identifying a boat, within a circle of free water.

The programme is a list of throttles with their durations: coasting, steps ahead and astern, turns
on either side, a zigzag, and random steps of each thruster, drawn once from a seed. Two guards
override it. *The circle*: when the boat would no longer stop before the rim, it turns back to the
middle, and the programme waits. *The speed*: above the limit the boat gets no more thrust in its
direction of motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grebe.core.errors import PlanError, UsageError
from grebe.core.vessel import Vessel

Throttles = tuple[float, float]
DURATION_S = 180.0
# The return ends this near the middle, as a share of the radius.
BACK_SHARE = 0.35
# Smallest radius, in stopping distances from the speed limit.
ROOM = 4.0
# Throttles of the return.
BACK_AHEAD, BACK_TURN = 0.5, 0.6
NUDGE_S = 2.0
# Thrust that speeds the boat up ends at the first share of the speed limit, because thrusters lag,
# and is allowed again at the second.
EARLY, AGAIN = 0.85, 0.7


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A circle of free water about a middle (north, east) [m]."""

    north_m: float
    east_m: float
    radius_m: float

    def __post_init__(self) -> None:
        if not self.radius_m > 0:
            raise UsageError(
                f"A circle of {self.radius_m:g} m is impossible; give a positive radius.",
                settings=("radius_m",),
            )


@dataclass(frozen=True, kw_only=True)
class Leg:
    """Throttles (port, starboard), -1 to 1, for `duration_s`."""

    throttles: Throttles
    duration_s: float


def programme(duration_s: float = DURATION_S, seed: int = 0) -> tuple[Leg, ...]:
    """The legs of a manoeuvre, filled up to `duration_s` [s] with random steps."""
    legs = [
        *_legs((0.0, 0.0, 4.0), (0.6, 0.6, 6.0), (0.0, 0.0, 4.0), (1.0, 1.0, 5.0)),
        *_legs((-1.0, -1.0, 4.0), (0.0, 0.0, 3.0)),
        *_legs((1.0, 0.2, 5.0), (0.2, 1.0, 5.0), (1.0, 0.5, 4.0), (0.5, 1.0, 4.0)),
        *_legs((0.6, -0.6, 4.0), (-0.6, 0.6, 4.0), (0.0, 0.0, 3.0)),
    ]
    # The zigzag, at two amplitudes.
    for inner in (0.4, 0.0):
        legs += _legs((0.9, inner, 2.5), (inner, 0.9, 2.5), (0.9, inner, 2.5), (inner, 0.9, 2.5))
    random = np.random.default_rng(seed)
    left_s = duration_s - sum(leg.duration_s for leg in legs)
    while left_s > 0:
        port, starboard = random.choice([-0.7, -0.3, 0.0, 0.3, 0.5, 0.7, 0.85, 1.0], 2).tolist()
        hold_s = min(float(random.choice([0.8, 1.5, 3.0])), left_s)
        legs.append(Leg(throttles=(port, starboard), duration_s=hold_s))
        left_s -= hold_s
    return tuple(legs)


def _legs(*numbers: tuple[float, float, float]) -> list[Leg]:
    return [Leg(throttles=(port, starboard), duration_s=s) for port, starboard, s in numbers]


def stopping_m(vessel: Vessel, speed_mps: float) -> float:
    """Stopping distance [m] with full thrust astern, for a boat of twice the mass.

    The factor of two is a margin, because the vessel is not known yet.
    """
    if speed_mps <= 0:
        return 0.0
    # The larger of full thrust astern and half the drag at this speed, and not their sum.
    brake = max(-2 * vessel.thrust_min_n, vessel.surge_drag_n(speed_mps) / 2, 1e-9)
    return vessel.m11_kg * speed_mps**2 / brake


class Manoeuvre:
    """The programme under its guards: a controller from time and state to thrusts.

    Its only memory is its progress. It begins once the boat is in the circle and ends after the
    time of its programme. Returns to the middle count towards that time: they show the boat's
    behaviour as well.
    """

    def __init__(
        self,
        vessel: Vessel,
        circle: Circle,
        *,
        speed_max_mps: float,
        legs: Sequence[Leg] | None = None,
    ) -> None:
        if not 0 < speed_max_mps < math.inf:
            raise UsageError(
                f"A speed limit of {speed_max_mps:g} m/s is too low for a manoeuvre; raise it.",
                settings=("speed_max_mps",),
            )
        need = ROOM * stopping_m(vessel, min(speed_max_mps, vessel.speed_max_mps))
        if circle.radius_m < need:
            raise PlanError(
                f"A circle of {circle.radius_m:.0f} m is too small for {vessel.name} at "
                f"{speed_max_mps:g} m/s, which takes {need:.0f} m; lower the speed or give more "
                "water.",
                settings=("radius_m", "speed_max_mps"),
            )
        self.vessel = vessel
        self.circle = circle
        self._speed_max_mps = speed_max_mps
        self._legs = tuple(legs or programme())
        self.duration_s = sum(leg.duration_s for leg in self._legs)
        self._driven_s = 0.0
        self._before_s: float | None = None
        self._began_s: float | None = None
        self._returns = False
        self._is_fast = False

    @property
    def is_over(self) -> bool:
        """Whether the programme's time is over."""
        if self._began_s is None or self._before_s is None:
            return False
        return self._before_s - self._began_s >= self.duration_s - 1e-9

    def thrusts(self, time_s: float, state: Sequence[float]) -> tuple[float, float]:
        """Thrusts [N] from `time_s` on, for a boat in `state` (6,)."""
        if not self._returns and self._before_s is not None:
            self._driven_s += time_s - self._before_s
        self._before_s = time_s
        if self.is_over:
            return 0.0, 0.0
        self._returns = self._must_return(state)
        if self._began_s is None and not self._returns:
            self._began_s = time_s
        throttles = self._way_back(state) if self._returns else self._leg().throttles
        port, starboard = self._slowed(throttles, state[3])
        return self.vessel.thrust_of(port), self.vessel.thrust_of(starboard)

    def _leg(self) -> Leg:
        ahead = self._driven_s
        for leg in self._legs:
            ahead -= leg.duration_s
            if ahead < -1e-9:
                return leg
        return self._legs[-1]

    def _must_return(self, state: Sequence[float]) -> bool:
        north, east = state[0] - self.circle.north_m, state[1] - self.circle.east_m
        away = math.hypot(north, east)
        if self._returns:
            return away > BACK_SHARE * self.circle.radius_m
        outwards = self._outwards(state, north, east, away)
        speed = math.hypot(state[3], state[4])
        reach = away + stopping_m(self.vessel, speed) + NUDGE_S * max(outwards, 0.0)
        return reach > 0.85 * self.circle.radius_m

    @staticmethod
    def _outwards(state: Sequence[float], north: float, east: float, away: float) -> float:
        """Speed away from the middle [m/s]."""
        cos, sin = math.cos(state[2]), math.sin(state[2])
        north_speed, east_speed = cos * state[3] - sin * state[4], sin * state[3] + cos * state[4]
        return (north * north_speed + east * east_speed) / max(away, 1e-9)

    def _way_back(self, state: Sequence[float]) -> Throttles:
        """Throttles towards the middle: turn first, and go astern while still fast outwards."""
        bearing = math.atan2(self.circle.east_m - state[1], self.circle.north_m - state[0])
        off = math.remainder(bearing - state[2], 2 * math.pi)
        turn = BACK_TURN * min(max(1.2 * off - 0.8 * state[5], -1.0), 1.0)
        ahead = BACK_AHEAD * max(math.cos(off), 0.0)
        if math.cos(off) < 0 and state[3] > 0.3:
            ahead = -BACK_AHEAD
        return _held(ahead + turn), _held(ahead - turn)

    def _slowed(self, throttles: Throttles, surge_mps: float) -> Throttles:
        """Remove the mean throttle if it would exceed the speed limit either way; keep turns."""
        port, starboard = throttles
        mean = (port + starboard) / 2
        limit = (AGAIN if self._is_fast else EARLY) * self._speed_max_mps
        self._is_fast = abs(surge_mps) > limit
        if self._is_fast and mean * surge_mps > 0:
            port, starboard = port - mean, starboard - mean
        return port, starboard


def _held(throttle: float) -> float:
    return min(max(throttle, -1.0), 1.0)
