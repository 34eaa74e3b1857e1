"""Where a map errs more than elsewhere: at a front, at the edge of a plume, over weeds.

A covariance is the same everywhere, and so is the standard deviation it leaves at a given distance
from the samples. The errors at left-out stretches of the boat's path show where that is too small
and where too large. The result is used only if it predicts the errors of other stretches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

from grebe.mapping.proof.validation import Z50, Errors
from grebe.mapping.way import blocks_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Side of the blocks of water [m]; all errors within a block are one piece of evidence.
BLOCK_M = 12.0
# Widths of the kernel that are tried [m]; the prior that all water is alike weighs as much as this
# many blocks at the place itself.
WIDTHS_M, BELIEF_BLOCKS = (15.0, 30.0, 60.0), 3.0
# The kernel is cut off at this many widths, and summed on a raster with this many cells a width.
LONGEST_REACH, CELLS_A_WIDTH = 3.0, 4
# Squared errors are limited to this: a normal error exceeds it once in 16,000.
LARGEST_SQUARE = 16.0
# The gain in log likelihood of the errors that is required, with each block counted once.
WORTH = 2.0
FEWEST_BLOCKS = 12


@dataclass(frozen=True, kw_only=True)
class Unrest:
    """Squares (k,) of the errors relative to their usual size, in blocks of water with `centres`
    (k, 2); and the width [m] of the kernel that carries them to other places.
    """

    centres: Array
    squares: Array
    width_m: float

    def factor(self, places: Array) -> Array:
        """The factor (m,) of the standard deviation at places (m, 2); about 1 on average."""
        squares, blocks = (
            field(places) for field in (self._carried(self.squares), self._carried(None))
        )
        return _believed(squares, blocks)

    def _carried(self, values: Array | None) -> RegularGridInterpolator:
        """An interpolator of the sum of the blocks' values, or of ones, each times its kernel. It
        is summed on a raster fine enough for the kernel, because maps have many nodes.
        """
        step = self.width_m / CELLS_A_WIDTH
        room = LONGEST_REACH * self.width_m
        low, high = self.centres.min(axis=0) - room, self.centres.max(axis=0) + room
        shape = np.ceil((high - low) / step).astype(int) + 1
        axes = [start + step * np.arange(count) for start, count in zip(low, shape, strict=True)]
        cells = np.rint((self.centres - low) / step).astype(int)
        raster = np.zeros(shape)
        np.add.at(raster, tuple(cells.T), 1.0 if values is None else values)
        spread = gaussian_filter(raster, CELLS_A_WIDTH, mode="constant", truncate=LONGEST_REACH) * (
            2 * np.pi * CELLS_A_WIDTH**2
        )
        return RegularGridInterpolator(axes, spread, bounds_error=False, fill_value=0.0)

    def factor_by_others(self, blocks: NDArray[np.int64]) -> Array:
        """The factor (m,) in the given blocks, from all other blocks."""
        pairs = KDTree(self.centres).sparse_distance_matrix(
            KDTree(self.centres), LONGEST_REACH * self.width_m, output_type="coo_matrix"
        )
        other = pairs.row != pairs.col
        row, col, away = pairs.row[other], pairs.col[other], pairs.data[other]
        weight = np.exp(-0.5 * (away / self.width_m) ** 2)
        count = len(self.centres)
        told = np.bincount(row, weight * self.squares[col], count)
        return _believed(told, np.bincount(row, weight, count))[blocks]


def unrest_of(stretches: Sequence[Errors]) -> Unrest | None:
    """Estimate unrest from the errors of left-out stretches; None if they show none."""
    places = np.concatenate([one.places for one in stretches])
    if not len(places):
        return None
    z = np.concatenate([one.z / _usual(one.z) for one in stretches if len(one.z)])
    blocks = blocks_of(places, BLOCK_M)
    inside = np.bincount(blocks)
    squares = np.bincount(blocks, np.minimum(z**2, LARGEST_SQUARE)) / inside
    # Water that does not vary has no errors anywhere.
    if len(inside) < FEWEST_BLOCKS or not squares.mean() > 0:
        return None
    squares /= squares.mean()
    centres = np.column_stack([np.bincount(blocks, axis) / inside for axis in places.T])
    tried = [Unrest(centres=centres, squares=squares, width_m=width) for width in WIDTHS_M]
    gains = [_gain(one) for one in tried]
    best = int(np.argmax(gains))
    return tried[best] if gains[best] > WORTH else None


def calmed(errors: Errors, unrest: Unrest | None) -> Errors:
    """Errors with their standard deviations scaled by the unrest of all blocks but their own."""
    if unrest is None or not len(errors.places):
        return errors
    _, own = KDTree(unrest.centres).query(errors.places)
    return replace(errors, sd=errors.sd * unrest.factor_by_others(np.asarray(own, np.int64)))


def _believed(squares: NDArray[Any], blocks: NDArray[Any]) -> Array:
    """A factor from the weighted squares and the weight of their blocks."""
    return np.sqrt((BELIEF_BLOCKS + squares) / (BELIEF_BLOCKS + blocks))


def _gain(unrest: Unrest) -> float:
    """The gain in log likelihood from factors by other blocks, where each block's square counts as
    that of one normal error.
    """
    variance = unrest.factor_by_others(np.arange(len(unrest.squares))) ** 2
    return 0.5 * float(np.sum(unrest.squares * (1 - 1 / variance) - np.log(variance)))


def _usual(z: Array) -> float:
    """The usual size of standardised errors, by their median."""
    return max(float(np.median(np.abs(z))) / Z50, 1e-9)
