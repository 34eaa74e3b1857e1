"""A known value along the shore, for any method whose field uses `Readings.extra_sd`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.mapping.methods.base import Domain, Method, Readings
from grebe.mapping.methods.passing_on import PassingField

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Pseudo-readings along all shores, if no spacing is given.
DEFAULT_COUNT = 200


@dataclass(frozen=True, kw_only=True)
class WithShore:
    """A method whose field also uses pseudo-readings along the shore, including islands': `value`
    with the standard deviation `sd`, in the quantity's unit, every `spacing_m`.

    The model is fitted to the real readings alone.
    """

    method: Method
    sd: float
    value: float = 0.0
    spacing_m: float | None = None

    @property
    def key(self) -> str:
        """The key of the wrapped method."""
        return self.method.key

    @property
    def label(self) -> str:
        """The label of the wrapped method, and the value assumed along the shore."""
        return f"{self.method.label}, {self.value:g} ± {self.sd:g} along the shore"

    def fit(self, readings: Readings, domain: Domain) -> ShoredField:
        """See `Method`."""
        places = shore_places(domain.outline, self.spacing_m)
        shore = Readings(
            positions=places,
            values=np.full(len(places), self.value),
            extra_sd=np.full(len(places), self.sd),
        )
        plain = self.method.fit(readings, domain)
        return ShoredField(field=plain.given(_together(readings, shore)), shore=shore)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShoredField(PassingField):
    """A field that adds the shore's pseudo-readings to whatever readings it is given."""

    shore: Readings

    def given(self, readings: Readings) -> ShoredField:
        """See `Field`."""
        return ShoredField(
            field=self.field.given(_together(readings, self.shore)), shore=self.shore
        )


def shore_places(water: shapely.Polygon, spacing_m: float | None = None) -> Array:
    """Evenly spaced places along all shores of the water, (n, 2)."""
    spacing = spacing_m or water.length / DEFAULT_COUNT
    places: list[Array] = []
    for ring in (water.exterior, *water.interiors):
        count = max(3, math.ceil(ring.length / spacing))
        at = shapely.line_interpolate_point(ring, np.arange(count) / count * ring.length)
        places.append(shapely.get_coordinates(at))
    return np.concatenate(places)


def _together(readings: Readings, shore: Readings) -> Readings:
    extra = np.zeros(len(readings)) if readings.extra_sd is None else readings.extra_sd
    assert shore.extra_sd is not None
    return Readings(
        positions=np.concatenate([readings.positions, shore.positions]),
        values=np.concatenate([readings.values, shore.values]),
        extra_sd=np.concatenate([extra, shore.extra_sd]),
    )
