"""How far a map's standard deviations can be trusted, on the boat's path and off it.

A sensor's readings agree better along one pass than between two: the water changes between passes,
and sensors lag and drift. A covariance of place alone cannot distinguish the two. So two kinds of
pieces are left out: stretches of the path, framed by readings of the same pass, and whole lines,
framed by other passes only. Each kind gives a factor by which standard deviations are wrong. Beside
the path, the first factor gives way to the second within metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from grebe.mapping.proof.unrest import Unrest
from grebe.mapping.proof.validation import Z50, Z95, Errors
from grebe.mapping.way import REACH_M, off_the_way

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Factors beyond these are the fault of the data and not of the model.
LEAST, MOST = 0.3, 6.0
# The prior that the model is right weighs as much as this many left-out pieces.
BELIEF_PIECES = 3.0


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Factors of the standard deviations on the path and off it. `way` (n, 2) is the path through
    the samples, and places within `wide_m` of it are on it. `unrest` gives where errors are larger
    than elsewhere.
    """

    on_way: float = 1.0
    off_way: float = 1.0
    way: Array | None = None
    wide_m: float = 0.0
    unrest: Unrest | None = None

    def factor(self, places: Array) -> Array:
        """The factor at each place (m, 2)."""
        usual = self._usual(places)
        return usual if self.unrest is None else usual * self.unrest.factor(places)

    def _usual(self, places: Array) -> Array:
        """The factor at each place, without the effect of `unrest`."""
        if self.way is None or self.on_way == self.off_way:
            return np.full(len(places), self.on_way)
        away = np.maximum(off_the_way(self.way, places) - self.wide_m, 0.0)
        beside = 1.0 - np.exp(-away / REACH_M)
        return self.on_way * (self.off_way / self.on_way) ** beside


def spread(errors: Errors, pieces: int) -> float:
    """By what factor standard deviations are too small: the 50 % and 95 % quantiles of the absolute
    standardised errors, compared with those of a normal distribution.
    """
    if len(errors.error) == 0:
        return 1.0
    size = np.abs(errors.z)
    found = np.quantile(size, [0.5, 0.95]) / [Z50, Z95]
    raw = float(np.sqrt(max(found[0], 1e-3) * max(found[1], 1e-3)))
    believed = raw ** (pieces / (pieces + BELIEF_PIECES))
    return float(np.clip(believed, LEAST, MOST))


def for_few(pieces: int) -> float:
    """How much wider a 95 % interval has to be if its width was estimated from so few left-out
    pieces, each with an error of its own: Student's quantile over the normal one.
    """
    return float(stdtrit(max(pieces - 1, 1), 0.975)) / Z95
