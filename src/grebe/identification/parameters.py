"""What is estimated of a boat, and in which coordinates: positive numbers by their logarithm.

Motion alone tells masses, drags and thrusts up to one common factor, so the thrust at full command
ahead is taken as known (the vessel's `thrust_max_n`, or a pull measured at a bollard). In yaw
the same would hold for arm, moment of inertia and drag, but for the moment (m11 - m22) u v, which
has the scale of surge and sway: the arm is believed as a tape has it, to a few per cent, and told
where a boat sways enough. Beside the boat's own numbers there are those of the day: current, wind,
a compass that is off; they are told so that the boat's are not blamed for them.
"""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.vessel import Vessel
from grebe.identification.thrusters import Thrusters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

MASSES = ("m11_kg", "m22_kg", "m33_kgm2")
DRAGS = ("x_u", "x_uu", "y_v", "y_vv", "n_r", "n_rr")
# What a preset is trusted to, as a standard deviation of the logarithm: a factor of e.
PRIOR_LOG_SD = 1.0
# An arm is taken with a tape; only a wake on the hull makes it act as another.
ARM_LOG_SD = 0.03
# A first guess at a lag where the vessel has none [s].
FIRST_LAG_S = 0.15
LEAST_TOLD_LAG_S = 0.05


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter that is estimated: `start` and `prior_sd` in its own coordinate, the
    logarithm where `log`. `unit` of the number itself; `of_the_day` where it is not the boat's own.
    """

    name: str
    unit: str
    start: float
    prior_sd: float
    log: bool = False
    low: float = -math.inf
    high: float = math.inf
    of_the_day: bool = False

    def value(self, coordinate: float) -> float:
        """The number itself."""
        return math.exp(coordinate) if self.log else coordinate


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A boat and a day that may be the true ones.

    `weather` is (current north, current east [m/s], force north, force east [N]).
    """

    vessel: Vessel
    thrusters: Thrusters
    weather: tuple[float, float, float, float]
    compass_rad: float


@dataclass(frozen=True, kw_only=True)
class Model:
    """The coordinates theta (p,) of what is estimated, and what they stand for.

    `base` says what is not estimated, and which drags there are.
    """

    base: Vessel
    parameters: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the order of the coordinates."""
        return tuple(one.name for one in self.parameters)

    @property
    def start(self) -> Array:
        """Coordinates (p,) to begin from, which are the preset's."""
        return np.array([one.start for one in self.parameters])

    @property
    def prior_sd(self) -> Array:
        """Standard deviations (p,) of the coordinates about `start` before any log is seen."""
        return np.array([one.prior_sd for one in self.parameters])

    def clipped(self, theta: Array) -> Array:
        """Coordinates within their bounds."""
        low = [one.low for one in self.parameters]
        high = [one.high for one in self.parameters]
        return np.clip(theta, low, high)

    def told_apart(self, theta: Array) -> Array:
        """Coordinates at which lag and latency can be distinguished.

        Where there is no lag, a little of it is to first order the same as as much latency.
        """
        out = theta.copy()
        lag, latency = self.names.index("thruster_lag_s"), self.names.index("latency_s")
        more = max(LEAST_TOLD_LAG_S - float(out[lag]), 0.0)
        out[lag] += more
        out[latency] -= more
        return out

    def before(self, name: str) -> float | None:
        """What the preset says of a parameter; None where it says nothing."""
        known = getattr(self.base, name, None)
        return None if known is None else abs(float(known))

    def values(self, theta: Array) -> dict[str, float]:
        """The numbers by name; drags as positive sizes."""
        return {
            one.name: one.value(float(t)) for one, t in zip(self.parameters, theta, strict=True)
        }

    def candidate(self, theta: Array) -> Candidate:
        """The boat and the day that coordinates stand for."""
        told = self.values(theta)
        astern = told["thrust_min_n"]
        vessel = replace(
            self.base,
            **{name: told[name] for name in MASSES},
            **{name: -told[name] for name in DRAGS if name in told},
            arm_m=told["arm_m"],
            thrust_min_n=-astern,
            throttle_exponent=told["throttle_exponent"],
            thruster_lag_s=told["thruster_lag_s"],
        )
        return Candidate(
            vessel=vessel,
            thrusters=Thrusters(
                full_ahead_n=vessel.thrust_max_n,
                full_astern_n=astern,
                exponent=vessel.throttle_exponent,
                lag_s=vessel.thruster_lag_s,
                latency_s=told["latency_s"],
                trim=told["trim"],
            ),
            weather=(
                told["current_north_mps"],
                told["current_east_mps"],
                told["wind_north_n"],
                told["wind_east_n"],
            ),
            compass_rad=told["compass_rad"],
        )

    def with_missing_drags(self) -> Model:
        """The same with every drag that the preset has none of, from nothing upwards."""
        missing = [name for name in DRAGS if name not in self.names]
        more = [_missing_drag(self.base, name) for name in missing]
        return Model(base=self.base, parameters=(*self.parameters, *more))

    def without(self, names: Container[str]) -> Model:
        """The same without some coordinates."""
        left = tuple(one for one in self.parameters if one.name not in names)
        return Model(base=self.base, parameters=left)


def model_of(preset: Vessel) -> Model:
    """The coordinates about a preset: its drags alone, others are added where a log asks."""
    boat = [
        Parameter(
            name=name,
            unit="kg m^2" if name == "m33_kgm2" else "kg",
            start=math.log(getattr(preset, name)),
            prior_sd=PRIOR_LOG_SD,
            log=True,
        )
        for name in MASSES
    ]
    boat += [_drag(name, -getattr(preset, name)) for name in DRAGS if getattr(preset, name) < 0]
    return Model(base=preset, parameters=(*boat, *_drive(preset), *_of_the_day(preset)))


_DRAG_UNITS = {
    "x_u": "N s/m", "y_v": "N s/m", "n_r": "N m s",
    "x_uu": "N s^2/m^2", "y_vv": "N s^2/m^2", "n_rr": "N m s^2",
}  # fmt: skip


def _drag(name: str, size: float) -> Parameter:
    return Parameter(
        name=name, unit=_DRAG_UNITS[name], start=math.log(size), prior_sd=PRIOR_LOG_SD, log=True
    )


def _missing_drag(preset: Vessel, name: str) -> Parameter:
    """A drag of which nothing is known but the size of its partner, linear or quadratic."""
    partner = name[:3] if len(name) == 4 else name + name[-1]
    size = -getattr(preset, partner)
    return Parameter(name=name, unit=_DRAG_UNITS[name], start=0.0, prior_sd=3.0 * size, low=0.0)


def _drive(preset: Vessel) -> list[Parameter]:
    """The thrusters and the time that passes until they act."""
    astern = max(-preset.thrust_min_n, 0.05 * preset.thrust_max_n)
    return [
        Parameter(
            name="arm_m", unit="m", start=math.log(preset.arm_m), prior_sd=ARM_LOG_SD, log=True
        ),
        Parameter(name="thrust_min_n", unit="N", start=math.log(astern), prior_sd=0.7, log=True),
        Parameter(
            name="throttle_exponent",
            unit="",
            start=math.log(preset.throttle_exponent),
            prior_sd=0.5,
            log=True,
            low=math.log(0.3),
            high=math.log(4.0),
        ),
        Parameter(
            name="thruster_lag_s",
            unit="s",
            start=preset.thruster_lag_s or FIRST_LAG_S,
            prior_sd=1.0,
            low=0.0,
            high=10.0,
        ),
        Parameter(name="latency_s", unit="s", start=0.1, prior_sd=1.0, low=-0.5, high=5.0),
    ]


def _of_the_day(preset: Vessel) -> list[Parameter]:
    force = 0.1 * preset.thrust_max_n
    return [
        Parameter(name="trim", unit="", start=0.0, prior_sd=0.2, of_the_day=True),
        *(
            Parameter(name=name, unit="m/s", start=0.0, prior_sd=0.3, of_the_day=True)
            for name in ("current_north_mps", "current_east_mps")
        ),
        *(
            Parameter(name=name, unit="N", start=0.0, prior_sd=force, of_the_day=True)
            for name in ("wind_north_n", "wind_east_n")
        ),
        Parameter(
            name="compass_rad", unit="rad", start=0.0, prior_sd=math.radians(5), of_the_day=True
        ),
    ]
