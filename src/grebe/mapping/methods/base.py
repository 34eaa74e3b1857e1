"""Fit, then query: what a map's method is given, and what it returns.

A `Method` is a frozen value with its own settings. Its `fit` takes the `Readings` of one quantity
and the `Domain` that the map covers, and returns a `Field`: the signal's mean, standard deviation
and draws at any place of the water, and the `Model` behind it. Anything with these members is a
method; nothing has to be inherited or registered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import shapely

from grebe.mapping.covariance.models import Fleeting
from grebe.mapping.covariance.variogram import EmpiricalVariogram
from grebe.mapping.fields.spde import Mesh, coarse_mesh
from grebe.mapping.grid import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """Readings of one quantity: `values` (n,) in its unit at `positions` (n, 2) [m], north and
    east, and at `times` (n,) [unix s] if known.

    `extra_sd` (n,): standard deviation of a value's error in addition to the sensor's noise.
    `moment_s`: the time [unix s] of the field to make from them; None: at each place, the time when
    the boat was near. `spread_m`: if each value is a mean of the water over a stretch of the path,
    the mean distance between two places of that stretch.
    """

    positions: Array
    values: Array
    times: Array | None = None
    extra_sd: Array | None = None
    moment_s: float | None = None
    spread_m: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.values)
        if self.positions.shape != (n, 2):
            raise ValueError(
                f"{n} values need positions of shape ({n}, 2), not {self.positions.shape}"
            )

    def __len__(self) -> int:
        return len(self.values)

    def part(self, chosen: NDArray[np.bool_]) -> Readings:
        """The readings where `chosen` (n,) is true."""
        return Readings(
            positions=self.positions[chosen],
            values=self.values[chosen],
            times=None if self.times is None else self.times[chosen],
            extra_sd=None if self.extra_sd is None else self.extra_sd[chosen],
            moment_s=self.moment_s,
            spread_m=self.spread_m,
        )


@dataclass(frozen=True)
class Domain:
    """The water that a map covers, and the grid of its nodes; meshes are made on first use."""

    outline: shapely.Polygon
    grid: Grid

    def __getstate__(self) -> dict[str, Any]:
        """Leave the meshes out: another process makes its own."""
        return {"outline": self.outline, "grid": self.grid}

    @cached_property
    def mesh(self) -> Mesh:
        """The map's own nodes and the links between them that do not cross land."""
        return Mesh(self.grid, self.outline)

    @cached_property
    def coarse_mesh(self) -> Mesh:
        """A mesh coarse enough for fitting parameters."""
        return coarse_mesh(self.outline)


@dataclass(frozen=True, kw_only=True)
class Companions:
    """The quantities whose readings help to map another: their `names`, their `correlations` with
    it, and `spared`, the share by which they reduce the standard deviation at the median place. If
    they are not `heeded`, the quantity is mapped alone.
    """

    names: tuple[str, ...]
    correlations: tuple[float, ...]
    spared: float
    heeded: bool


@dataclass(frozen=True, kw_only=True)
class Model:
    """The model behind a field, as reports and files print it.

    `nugget` is the variance of a reading about the signal, `sill` the signal's variance, `range_m`
    the covariance's own parameter, and `practical_range_m` the distance at which 95 % of the
    correlation is gone; None if a method has no such parameter. `ratio` is that of the ranges
    across and along `angle_deg` (clockwise from north). `semivariance` is the model's curve over
    distance [m], and `empirical` the variogram it was fitted to or is shown beside. `companions`
    are the quantities that were mapped together with it. `passing` is the process by which passes
    differ; `parts` are the models of which this is the mean.
    """

    kind: str
    text: str
    nugget: float
    sill: float | None = None
    range_m: float | None = None
    practical_range_m: float | None = None
    ratio: float = 1.0
    angle_deg: float = 0.0
    passing: Fleeting | None = None
    parts: tuple[Model, ...] = ()
    companions: Companions | None = None
    reason: str = field(default="", compare=False)
    standard_errors: Mapping[str, float] = field(default_factory=dict[str, float], compare=False)
    semivariance: Callable[[Array], Array] | None = field(default=None, compare=False)
    empirical: EmpiricalVariogram | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.nugget) and self.nugget >= 0):
            raise ValueError(f"a model's nugget is a variance of at least 0, not {self.nugget}")


class Field(Protocol):
    """The signal given the readings. Places are (m, 2) [m], north and east, in the water."""

    @property
    def model(self) -> Model:
        """The model behind the field."""
        ...

    def mean(self, places: Array) -> Array:
        """The best estimate of the signal, (m,)."""
        ...

    def sd(self, places: Array) -> Array:
        """Standard deviation of the signal about its mean, (m,), without the readings' noise."""
        ...

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """Equally likely signals given the readings, (count, m)."""
        ...

    def given(self, readings: Readings) -> Field:
        """The field that the same model gives for other readings.

        Validation calls this for every fold, so the result may be coarser than this field.
        """
        ...


@runtime_checkable
class Timed(Protocol):
    """A field that models how the water differs between times. Other fields need not have this
    method.
    """

    def at_moments(self, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
        """Mean and standard deviation of the signal, (m,) each, at each time (k,) [unix s]."""
        ...


def field_at_moments(field: Field, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
    """As `Timed`, for any field: one that does not model time is the same at all times."""
    if isinstance(field, Timed):
        return field.at_moments(places, moments_s)
    return [(field.mean(places), field.sd(places))] * len(moments_s)


class Method(Protocol):
    """A way to make a field from readings; a frozen value with its own settings."""

    @property
    def key(self) -> str:
        """A short name for files."""
        ...

    @property
    def label(self) -> str:
        """A name for people."""
        ...

    def fit(self, readings: Readings, domain: Domain) -> Field:
        """Fit to readings. Raises `ValueError` if they do not determine a field."""
        ...
