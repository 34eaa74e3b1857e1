"""The boat's state from positions, velocities, headings and turns that come one by one.

There are three small Kalman filters, for north, east and heading. Each models a value whose rate is
driven by white noise (Bar-Shalom, Li & Kirubarajan 2001, sec. 6.2.2), as strong as the boat's
thrusters can make it. Measurements are of the value or of the rate.
"""

from __future__ import annotations

import math

from grebe.core.events import State
from grebe.core.frames import LocalFrame
from grebe.core.vessel import Vessel
from grebe.links.nmea.sentences import PLAIN_ERROR_M, Heading, Position, TurnRate, Velocity

# Standard deviations of the velocity, heading and turn that receivers and compasses report
# [m/s, rad, rad/s].
VELOCITY_ERROR_MPS, HEADING_ERROR_RAD, TURN_ERROR_RADPS = 0.05, 0.015, 0.01
# How long the boat's thrust keeps one direction, which sets the strength of the noise [s].
THRUST_S = 0.2
# A magnetic heading is ignored while the last true one is younger than this [s].
TRUE_FOR_S = 3.0


class ValueFilter:
    """One value and its rate; `acceleration` is the largest second derivative that the boat can
    cause.

    Time never runs back: a late measurement counts as one at the newest time.
    """

    def __init__(self, acceleration: float) -> None:
        self._density = acceleration**2 * THRUST_S
        self.time_s = math.nan
        self.value = self.rate = 0.0
        self._pvv = self._pvr = 0.0
        self._prr = (2 * acceleration) ** 2

    def measure_value(self, time_s: float, value: float, error: float) -> None:
        """Take a measurement of the value into account."""
        if math.isnan(self.time_s):
            self.time_s, self.value, self._pvv = time_s, value, error**2
            return
        self._predict(time_s)
        scale = self._pvv + error**2
        self._correct(value - self.value, self._pvv / scale, self._pvr / scale, of_rate=False)

    def measure_rate(self, time_s: float, rate: float, error: float) -> None:
        """Take a measurement of the rate into account; ignored before the first value."""
        if math.isnan(self.time_s):
            return
        self._predict(time_s)
        scale = self._prr + error**2
        self._correct(rate - self.rate, self._pvr / scale, self._prr / scale, of_rate=True)

    def at(self, time_s: float) -> float:
        """Return the value at a time near the last measurement, before or after it."""
        return self.value + self.rate * (time_s - self.time_s)

    def _predict(self, time_s: float) -> None:
        step = max(0.0, time_s - self.time_s)
        self.time_s += step
        self.value += self.rate * step
        self._pvv += step * (2 * self._pvr + step * self._prr) + self._density * step**3 / 3
        self._pvr += step * self._prr + self._density * step**2 / 2
        self._prr += self._density * step

    def _correct(self, error: float, to_value: float, to_rate: float, *, of_rate: bool) -> None:
        self.value += to_value * error
        self.rate += to_rate * error
        if of_rate:
            self._pvv -= to_value * self._pvr
            self._pvr -= to_value * self._prr
            self._prr -= to_rate * self._prr
        else:
            self._prr -= to_rate * self._pvr
            self._pvr -= to_rate * self._pvv
            self._pvv -= to_value * self._pvv


class Navigator:
    """Estimates the boat's state in a survey's frame; `variation_rad` is for the compass if no
    sentence gives it.
    """

    def __init__(
        self, frame: LocalFrame, vessel: Vessel, variation_rad: float | None = None
    ) -> None:
        self._frame = frame
        acceleration = 2 * vessel.thrust_max_n / vessel.m11_kg
        turn = vessel.arm_m * (vessel.thrust_max_n - vessel.thrust_min_n) / vessel.m33_kgm2
        self._north, self._east, self._heading = (
            ValueFilter(acceleration),
            ValueFilter(acceleration),
            ValueFilter(turn),
        )
        self.variation_rad = variation_rad
        # The times of the last position and the last usable heading [s].
        self.position_s = self.heading_s = math.nan
        self._true_s = -math.inf
        self._error_m = PLAIN_ERROR_M

    def update_position(self, time_s: float, position: Position) -> bool:
        """Take a position into account; return whether it is newer than the last one. Without a
        stated error it has the last error that was stated.
        """
        self._error_m = self._error_m if position.error_m is None else position.error_m
        if time_s <= self.position_s:
            return False
        north, east = self._frame.to_local(position.lonlat).tolist()
        self._north.measure_value(time_s, north, self._error_m)
        self._east.measure_value(time_s, east, self._error_m)
        self.position_s = time_s
        return True

    def update_velocity(self, time_s: float, velocity: Velocity) -> None:
        """Take a velocity over ground into account."""
        for track, rate in zip((self._north, self._east), velocity.velocity, strict=True):
            track.measure_rate(time_s, rate, VELOCITY_ERROR_MPS)

    def update_heading(self, time_s: float, measured: Heading) -> bool:
        """Take a heading into account; return whether it could be used. A magnetic one is used only
        if the variation is known and there is no recent true one.
        """
        heading = measured.heading_rad
        if measured.true:
            self._true_s = time_s
        elif self.variation_rad is None or time_s - self._true_s < TRUE_FOR_S:
            return False
        else:
            heading += self.variation_rad
        predicted = heading if math.isnan(self.heading_s) else self._heading.at(time_s)
        near = predicted + math.remainder(heading - predicted, 2 * math.pi)
        self._heading.measure_value(time_s, near, HEADING_ERROR_RAD)
        self.heading_s = time_s
        return True

    def update_turn_rate(self, time_s: float, turn_rate: TurnRate) -> None:
        """Take a yaw rate into account."""
        self._heading.measure_rate(time_s, turn_rate.rate_radps, TURN_ERROR_RADPS)

    def state(self, time_s: float) -> State:
        """Return the state at a time near the last sentences; not numbers before there are any."""
        north, east, heading = (
            track.at(time_s) for track in (self._north, self._east, self._heading)
        )
        forth, across = self._north.rate, self._east.rate
        cos, sin = math.cos(heading), math.sin(heading)
        surge, sway = cos * forth + sin * across, cos * across - sin * forth
        return north, east, heading, surge, sway, self._heading.rate
