"""The simulated boat: Eq. (9) at a finer step than the controller's, in the true weather."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from grebe.core.dynamics import CALM, Weather, rates, rk4
from grebe.core.errors import InputError
from grebe.core.vessel import Vessel
from grebe.simulation.changing import WeatherAt

PLANT_STEP_S = 0.05
# Largest number of substeps in a step.
MOST_SUBSTEPS = 200
# Parameters in which a real boat differs from its data sheet: load, growth on the hull, propellers.
UNCERTAIN = ("m11_kg", "m22_kg", "m33_kgm2", "x_u", "y_v", "n_r", "x_uu", "y_vv", "n_rr", "arm_m")


class Plant:
    """A boat on the water; thrusts hold until the next command.

    Thrusts are clipped to the vessel's limits and are zero within its dead band. If the vessel has
    a thruster lag, they follow the command with that time constant. `effectiveness` is the share of
    its thrust that each thruster actually gives.
    """

    def __init__(
        self,
        vessel: Vessel,
        state: tuple[float, float, float, float, float, float],
        weather: Weather | WeatherAt = CALM,
        effectiveness: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        self.vessel = vessel
        self.state: list[float] = list(state)
        self.effectiveness = effectiveness
        self._weather = weather
        self.time_s = 0.0
        self.thrusts = (0.0, 0.0)
        self._commanded = (0.0, 0.0)

    @property
    def weather(self) -> Weather:
        """The present weather."""
        return self._weather if isinstance(self._weather, Weather) else self._weather(self.time_s)

    @weather.setter
    def weather(self, weather: Weather) -> None:
        self._weather = weather

    @property
    def _given(self) -> tuple[float, float]:
        return (
            self.thrusts[0] * self.effectiveness[0],
            self.thrusts[1] * self.effectiveness[1],
        )

    def command(self, thrusts: tuple[float, float]) -> None:
        """Set the thrusts (F_1, F_2) [N], clipped to the limits."""
        self._commanded = (self._possible(thrusts[0]), self._possible(thrusts[1]))

    def _possible(self, thrust: float) -> float:
        if abs(thrust) < self.vessel.thruster_dead_band_n:
            return 0.0
        return min(max(thrust, self.vessel.thrust_min_n), self.vessel.thrust_max_n)

    def advance(self, duration_s: float) -> None:
        """Advance the simulation, in equal steps of at most `PLANT_STEP_S`."""
        steps = max(1, math.ceil(duration_s / PLANT_STEP_S - 1e-9))
        step = duration_s / steps
        weather = self.weather.as_tuple()
        for _ in range(steps):
            self.thrusts = self._lagged(step)
            self.state = rk4(
                lambda z: rates(self.vessel, z, self._given, weather),
                self.state,
                step,
                self._substeps(step),
            )
        self.time_s += duration_s

    def _substeps(self, step_s: float) -> int:
        """Number of substeps: more if the motion decays within a step or the water passes fast.

        Raises `InputError` if it would exceed `MOST_SUBSTEPS`.
        """
        weather, (_, _, _, surge, sway, yaw_rate) = self.weather, self.state
        current = math.hypot(weather.current_north_mps, weather.current_east_mps)
        boat, speed = self.vessel, math.hypot(surge, sway) + current
        rate = max(
            boat.fastest_rate_hz,
            -(boat.x_u + 2 * boat.x_uu * speed) / boat.m11_kg,
            -(boat.y_v + 2 * boat.y_vv * speed) / boat.m22_kg,
            -(boat.n_r + 2 * boat.n_rr * abs(yaw_rate)) / boat.m33_kgm2,
        )
        if not math.isfinite(rate) or rate * step_s > MOST_SUBSTEPS:
            raise InputError(
                f"The motion of the simulated {boat.name!r} cannot be computed: it decays at "
                f"{rate:.3g} a second, at {speed:.3g} m/s through the water; give it more mass, "
                "less drag, or less weather."
            )
        return max(1, math.ceil(rate * step_s))

    def _lagged(self, step_s: float) -> tuple[float, float]:
        if self.vessel.thruster_lag_s == 0:
            return self._commanded
        share = 1.0 - math.exp(-step_s / self.vessel.thruster_lag_s)
        (port, starboard), (to_port, to_starboard) = self.thrusts, self._commanded
        return port + share * (to_port - port), starboard + share * (to_starboard - starboard)


def mismatched(vessel: Vessel, share: float, seed: int) -> Vessel:
    """Return a vessel whose masses, drag and arm each differ by up to ± `share`."""
    factors = 1.0 + share * np.random.default_rng(seed).uniform(-1.0, 1.0, len(UNCERTAIN))
    changes = {
        name: getattr(vessel, name) * float(f) for name, f in zip(UNCERTAIN, factors, strict=True)
    }
    return replace(vessel, **changes)
