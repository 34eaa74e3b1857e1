"""Result of an identification: parameters with standard errors, and tests of their predictions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A value counts as determined if its standard error is below this share of it.
DETERMINED_SHARE = 0.25
CHANNELS = ("surge", "sway", "yaw rate")


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """One value with its standard error `sd`, in `unit`; `before` is the preset's value.

    `is_determined`: whether the log determines it, rather than the preset.
    """

    name: str
    unit: str
    value: float
    sd: float
    before: float | None
    is_determined: bool
    of_the_day: bool = False

    @property
    def text(self) -> str:
        """Value, standard error to two digits, and unit."""
        digits = max(0, 1 - math.floor(math.log10(self.sd))) if self.sd > 0 else 3
        # Adding 0.0 avoids a negative zero.
        value = round(self.value, digits) + 0.0
        return f"{value:.{digits}f} ± {self.sd:.{digits}f} {self.unit}".rstrip()


@dataclass(frozen=True, kw_only=True)
class Course:
    """Open-loop predictions of all pieces, for a plot.

    `times` (n,) [s] since the log's first row, `measured` and `predicted` (n, 3) surge, sway and
    yaw rate; `begins` (n,) marks the first row of a piece, `held_out` (n,) the rows that the fit
    had not seen.
    """

    times: Array
    measured: Array
    predicted: Array
    begins: NDArray[np.bool_]
    held_out: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class HoldOut:
    """Errors of the model's predictions, `horizon_s` ahead, of pieces that it had not seen.

    Root mean squares: `fitted` and `preset` (3,) are those of the velocities' errors [m/s, m/s,
    rad/s], the drifts those of the positions' at the end [m]. All include the noise of the
    measurements, `noise` (3,).
    """

    horizon_s: float
    pieces: int
    fitted: Array
    preset: Array
    fitted_drift_m: float
    preset_drift_m: float
    noise: Array


@dataclass(frozen=True, kw_only=True)
class Identification:
    """An identified boat, with its accuracy.

    `vessel` is ready to plan with. `latency_s` is the time from a command to its thrust by the
    log's clock, in addition to the thrusters' lag. `parameters` are all estimated parameters,
    `derived` quantities computed from several of them; `noise` (6,) are the standard deviations of
    the log's channels.
    """

    vessel: Vessel
    latency_s: float
    parameters: tuple[FittedValue, ...]
    derived: tuple[FittedValue, ...]
    noise: Array
    hold_out: HoldOut
    course: Course
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> FittedValue:
        """The parameter or derived quantity with this name."""
        return next(one for one in (*self.parameters, *self.derived) if one.name == name)
