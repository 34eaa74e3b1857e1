"""The difference of two surveys of the same water, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.quantity import Quantity
from grebe.mapping.proof.validation import Z95
from grebe.mapping.quantity_map import QuantityMap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Later minus earlier: `mean` and `sd` (rows, columns), with the two maps' errors independent.

    `clear` is true where zero is outside the 95 % interval.
    """

    mean: Array
    sd: Array

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Where the water has changed, at the 95 % level."""
        return np.abs(self.mean) > Z95 * self.sd


def refuse_other_unit(one: Quantity, other: Quantity) -> None:
    """Raise `InputError` if two surveys have a quantity in different units."""
    if one.unit != other.unit:
        raise InputError(
            f"{one.label} is in {one.unit or '1'} in one survey and in {other.unit or '1'} in "
            "another; import them in the same unit."
        )


def difference(earlier: QuantityMap, later: QuantityMap) -> Difference:
    """Subtract two maps of one quantity on one grid."""
    one, other = earlier.quantity, later.quantity
    if one.key != other.key or earlier.mean.shape != later.mean.shape:
        raise ValueError("a difference needs two maps of the same quantity on the same grid")
    refuse_other_unit(one, other)
    return Difference(mean=later.mean - earlier.mean, sd=np.hypot(earlier.sd, later.sd))
