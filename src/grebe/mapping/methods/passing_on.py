"""A field that forwards to another, so that a wrapper defines only what it changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.methods.base import Field, Model, Readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True, eq=False)
class PassingField:
    """Forwards every call to `field`."""

    field: Field

    @property
    def model(self) -> Model:
        """See `Field`."""
        return self.field.model

    def mean(self, places: Array) -> Array:
        """See `Field`."""
        return self.field.mean(places)

    def sd(self, places: Array) -> Array:
        """See `Field`."""
        return self.field.sd(places)

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """See `Field`."""
        return self.field.draws(places, count, seed)

    def given(self, readings: Readings) -> Field:
        """See `Field`."""
        return self.field.given(readings)
