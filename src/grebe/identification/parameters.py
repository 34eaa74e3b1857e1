"""The estimated parameters of a boat and their coordinates: logarithms of positive numbers.

Motion determines masses, drags and thrusts only up to a common factor, so the thrust at full
command ahead is taken as known (the vessel's `thrust_max_n`, or a pull measured at a bollard). In
yaw the same would hold for arm, moment of inertia and drag, except that the moment (m11 - m22) u v
has the scale of surge and sway. The arm's prior is its measured length, to a few per cent; the log
determines it if the boat sways enough. The boat's parameters are estimated together with those of
the day, such as current, wind and the compass's error, so that these do not distort the boat's.
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
# Prior standard deviation of a preset's logarithms: a factor of e.
PRIOR_LOG_SD = 1.0
# Prior standard deviation of the logarithm of the arm, which is measured with a tape; only a wake
# on the hull changes its effect.
ARM_LOG_SD = 0.03
# First guess of the lag if the vessel has none [s].
FIRST_LAG_S = 0.15
LEAST_DISTINCT_LAG_S = 0.05


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One estimated parameter.

    `start` and `prior_sd` are in its coordinate, the logarithm if `log`; `unit` is that of the
    value itself. `of_the_day`: it belongs to the day and not to the boat.
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
        """The value for a coordinate."""
        return math.exp(coordinate) if self.log else coordinate


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A possible boat and day.

    `weather` is (current north, current east [m/s], force north, force east [N]).
    """

    vessel: Vessel
    thrusters: Thrusters
    weather: tuple[float, float, float, float]
    compass_rad: float


@dataclass(frozen=True, kw_only=True)
class Model:
    """The coordinates theta (p,) of the estimated parameters, and their meaning.

    `base` is the preset, which holds everything that is not estimated and defines its drags.
    """

    base: Vessel
    parameters: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the order of the coordinates."""
        return tuple(one.name for one in self.parameters)

    @property
    def start(self) -> Array:
        """Initial coordinates (p,), those of the preset."""
        return np.array([one.start for one in self.parameters])

    @property
    def prior_sd(self) -> Array:
        """Prior standard deviations (p,) of the coordinates about `start`."""
        return np.array([one.prior_sd for one in self.parameters])

    def clipped(self, theta: Array) -> Array:
        """Coordinates clipped to their bounds."""
        low = [one.low for one in self.parameters]
        high = [one.high for one in self.parameters]
        return np.clip(theta, low, high)

    def with_distinct_lag(self, theta: Array) -> Array:
        """Coordinates at which lag and latency can be distinguished.

        If there is no lag, a small lag has to first order the effect of an equal latency.
        """
        out = theta.copy()
        lag, latency = self.names.index("thruster_lag_s"), self.names.index("latency_s")
        more = max(LEAST_DISTINCT_LAG_S - float(out[lag]), 0.0)
        out[lag] += more
        out[latency] -= more
        return out

    def before(self, name: str) -> float | None:
        """The preset's value of a parameter; None if it has none."""
        known = getattr(self.base, name, None)
        return None if known is None else abs(float(known))

    def values(self, theta: Array) -> dict[str, float]:
        """The values by name; drags as positive sizes."""
        return {
            one.name: one.value(float(t)) for one, t in zip(self.parameters, theta, strict=True)
        }

    def candidate(self, theta: Array) -> Candidate:
        """The boat and the day for some coordinates."""
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
        """The same model with the drags that the preset lacks, starting at zero."""
        missing = [name for name in DRAGS if name not in self.names]
        more = [_missing_drag(self.base, name) for name in missing]
        return Model(base=self.base, parameters=(*self.parameters, *more))

    def without(self, names: Container[str]) -> Model:
        """The same model without some coordinates."""
        left = tuple(one for one in self.parameters if one.name not in names)
        return Model(base=self.base, parameters=left)


def model_of(preset: Vessel) -> Model:
    """The model about a preset, with its drags only; `with_missing_drags` adds the others."""
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
    """A missing drag; its prior has the size of its linear or quadratic partner."""
    partner = name[:3] if len(name) == 4 else name + name[-1]
    size = -getattr(preset, partner)
    return Parameter(name=name, unit=_DRAG_UNITS[name], start=0.0, prior_sd=3.0 * size, low=0.0)


def _drive(preset: Vessel) -> list[Parameter]:
    """Parameters of the thrusters and of their delay."""
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
