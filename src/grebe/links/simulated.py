"""The link to a simulated boat."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from grebe.core.errors import LinkError, UsageError
from grebe.core.events import State
from grebe.links.base import NOT_A_STATE, BoatStatus, Observation, Order
from grebe.simulation.faults import NO_FAULTS, Faults
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import ReadsWater

OBSERVATION_PERIOD_S = 0.1


@dataclass(frozen=True, kw_only=True)
class EstimateErrors:
    """The errors of a boat's state estimates: standard deviations of position [m], heading [rad]
    and velocities [m/s, rad/s], the share of estimates that is lost, the bias of the compass [rad],
    and the delay [s]. `says_age`: whether the estimates state their delay.
    """

    position_m: float = 0.0
    heading_rad: float = 0.0
    velocity_mps: float = 0.0
    lost_share: float = 0.0
    heading_bias_rad: float = 0.0
    late_s: float = 0.0
    says_age: bool = True

    def __post_init__(self) -> None:
        errors = (self.position_m, self.heading_rad, self.velocity_mps, self.late_s)
        if not all(0 <= one < math.inf for one in errors):
            raise UsageError("Errors and delays of estimates must be finite and not negative.")
        if not 0 <= self.lost_share < 1:
            raise UsageError(
                f"The share of lost estimates must be 0 to less than 1, not {self.lost_share}."
            )

    @property
    def scale(self) -> tuple[float, float, float, float, float, float]:
        """The standard deviation of each element of the state."""
        place, turn, speed = self.position_m, self.heading_rad, self.velocity_mps
        return place, place, turn, speed, speed, speed


EXACT = EstimateErrors()


class SimulatedLink:
    """Observes a plant every `OBSERVATION_PERIOD_S` and reads a sonde.

    `faults` determine the battery, the depth and the blind times that the link reports. Estimates
    have independent normal errors, and some are lost: the next one then comes a period later, while
    the thrusts hold. Until its first order the boat stays where it was launched, at its mooring or
    ashore.
    """

    def __init__(
        self,
        plant: Plant,
        sonde: ReadsWater,
        errors: EstimateErrors = EXACT,
        seed: int = 0,
        source: str = "simulated",
        faults: Faults = NO_FAULTS,
    ) -> None:
        self.source = source
        self._plant = plant
        self._sonde = sonde
        self._errors = errors
        self._random = np.random.default_rng(seed)
        self._past = deque[State](maxlen=1 + round(errors.late_s / OBSERVATION_PERIOD_S))
        self._faults = faults
        self._started = self._told = False
        self._closed = False

    def observe(self) -> Observation:
        """Advance the plant to the next estimate; the first one is the start itself."""
        if self._closed:
            raise LinkError("The simulated boat has been closed.")
        if self._started:
            self._pass()
            while self._random.uniform() < self._errors.lost_share:
                self._pass()
        self._started = True
        blind = self._faults.is_blind(self._plant.time_s)
        self._past.append(NOT_A_STATE if blind else self._estimate())
        age_s = self._errors.late_s if self._errors.says_age else 0.0
        return Observation(time_s=self._plant.time_s, state=self._past[0], age_s=age_s)

    def _pass(self) -> None:
        """Let a period pass; a boat that has not set out does not move."""
        if self._told:
            self._plant.advance(OBSERVATION_PERIOD_S)
        else:
            self._plant.time_s += OBSERVATION_PERIOD_S

    def _estimate(self) -> State:
        errors = self._random.normal(size=6) * self._errors.scale
        north, east, heading, surge, sway, yaw_rate = (self._plant.state + errors).tolist()
        bias = self._errors.heading_bias_rad
        if bias:
            # The velocity over ground is known without the compass, which splits it into surge and
            # sway.
            surge, sway = (
                surge * math.cos(bias) + sway * math.sin(bias),
                sway * math.cos(bias) - surge * math.sin(bias),
            )
        return north, east, heading + bias, surge, sway, yaw_rate

    def command(self, order: Order) -> None:
        """Set the thrusts until the next command."""
        self._told = True
        self._plant.command(order.thrusts)

    def measure(self) -> Mapping[str, float]:
        """Return what the sonde reads at the boat's present place."""
        north, east = self._plant.state[0], self._plant.state[1]
        reading, depth = self._sonde.read(north, east), self._faults.depth_at(north, east)
        return reading if depth is None else {**reading, "water_depth_m": depth}

    def status(self) -> BoatStatus:
        """Return the status; a simulated boat is armed until it is closed."""
        return BoatStatus(
            mode="simulated",
            armed=not self._closed,
            battery_share=self._faults.share_left(self._plant.time_s),
            fix="simulated",
        )

    def stop(self) -> None:
        """Remove all thrust."""
        self._plant.command((0.0, 0.0))

    def close(self) -> None:
        """Leave the boat without thrust."""
        self.stop()
        self._closed = True
