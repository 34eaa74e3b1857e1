"""What is known of a boat after a drive: numbers with standard errors, and how they predict."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A number counts as determined where its standard error is below this share of it.
TOLD_SHARE = 0.25
CHANNELS = ("surge", "sway", "yaw rate")


@dataclass(frozen=True, kw_only=True)
class Told:
    """One number with its standard error `sd`, in `unit`; `before` is the preset's.

    `is_told`: whether the log says it, rather than the preset.
    """

    name: str
    unit: str
    value: float
    sd: float
    before: float | None
    is_told: bool
    of_the_day: bool = False

    @property
    def text(self) -> str:
        """Value, standard error to two digits, and unit."""
        digits = max(0, 1 - math.floor(math.log10(self.sd))) if self.sd > 0 else 3
        # No minus before what rounds to nothing.
        value = round(self.value, digits) + 0.0
        return f"{value:.{digits}f} ± {self.sd:.{digits}f} {self.unit}".rstrip()


@dataclass(frozen=True, kw_only=True)
class Course:
    """Pieces predicted without a look at what came, for a picture.

    `times` (n,) [s] since the log's first row, `measured` and `predicted` (n, 3) surge, sway and
    yaw rate; `begins` (n,) marks the first row of a piece, `held_out` (n,) rows the fit had not
    seen.
    """

    times: Array
    measured: Array
    predicted: Array
    begins: NDArray[np.bool_]
    held_out: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class HoldOut:
    """How a model that had not seen some pieces predicts them, `horizon_s` ahead at a time.

    Root mean squares: `fitted` and `preset` (3,) of the velocities' errors [m/s, m/s, rad/s], and
    of the positions' at the end [m]; all hold the noise of the measurements, `noise` (3,).
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
    """A boat that is known, and how well.

    `vessel` is ready to plan with; `latency_s` from a command to its thrust, as the log's clock
    has it, beside the thrusters' own lag. `parameters` are all that was told, `derived` what
    follows from them together; `noise` (6,) standard deviations of the log's channels.
    """

    vessel: Vessel
    latency_s: float
    parameters: tuple[Told, ...]
    derived: tuple[Told, ...]
    noise: Array
    hold_out: HoldOut
    course: Course
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> Told:
        """The parameter of a name."""
        return next(one for one in (*self.parameters, *self.derived) if one.name == name)
