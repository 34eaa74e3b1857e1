"""Fit, then ask: what a map's method is given, and what it answers.

A `Method` is a frozen value with its own settings. Its `fit` takes the `Readings` of one quantity
and the `Domain` that the map covers, and returns a `Field`: the signal's mean, standard deviation
and draws at any place of the water, and the `Model` that it is made of. Anything with these
members is a method; nothing has to be inherited or registered.
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
    """What was read of one quantity: `values` (n,) in its unit at `positions` (n, 2) [m], north
    and east, at `times` (n,) [unix s] where they are known.

    `extra_sd` (n,): standard deviation of a value's error besides the sensor's noise. `moment_s`
    [unix s]: when the field of them is asked for; None: at each place when the boat was near.
    """

    positions: Array
    values: Array
    times: Array | None = None
    extra_sd: Array | None = None
    moment_s: float | None = None

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
        )


@dataclass(frozen=True)
class Domain:
    """The water that a map covers, and the grid of its nodes; meshes are made when asked for."""

    outline: shapely.Polygon
    grid: Grid

    def __getstate__(self) -> dict[str, Any]:
        """Another process makes meshes of its own."""
        return {"outline": self.outline, "grid": self.grid}

    @cached_property
    def mesh(self) -> Mesh:
        """The map's own nodes and the links between them that no land crosses."""
        return Mesh(self.grid, self.outline)

    @cached_property
    def coarse_mesh(self) -> Mesh:
        """A mesh coarse enough to fit parameters on."""
        return coarse_mesh(self.outline)


@dataclass(frozen=True, kw_only=True)
class Companions:
    """The quantities by whose readings another one is mapped: their `names`, their `correlations`
    with it, and by which share of the standard deviation of the median place they make it surer.
    Where they are not `heeded` it is mapped alone.
    """

    names: tuple[str, ...]
    correlations: tuple[float, ...]
    spared: float
    heeded: bool


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a field is made of, as reports and files print it.

    `nugget` is the variance of a reading about the signal; `sill` the signal's variance, `range_m`
    the covariance's own parameter and `practical_range_m` where 95 % of the correlation is gone,
    None where a method knows no such thing. `ratio` of the ranges across and along `angle_deg`
    (clockwise from north). `semivariance` is the model's curve over distance [m], `empirical`
    what it was held to. `companions` are other quantities that were mapped together with it.
    `passing` is what passes differ by; of a mean of several `parts` are these.
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
        """What the field is made of."""
        ...

    def mean(self, places: Array) -> Array:
        """The best estimate of the signal, (m,)."""
        ...

    def sd(self, places: Array) -> Array:
        """Standard deviation of the signal about its mean, (m,); the readings' noise apart."""
        ...

    def draws(self, places: Array, count: int, seed: int) -> Array:
        """Equally likely signals given the readings, (count, m)."""
        ...

    def given(self, readings: Readings) -> Field:
        """The field that the same model makes of other readings.

        Validation asks for one for every fold, so it may be coarser than this field.
        """
        ...


@runtime_checkable
class Timed(Protocol):
    """A field that knows how the water differs from one moment to another. A field that does not
    need not have this.
    """

    def at_moments(self, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
        """Mean and standard deviation of the signal, (m,) each, at each moment (k,) [unix s]."""
        ...


def field_at_moments(field: Field, places: Array, moments_s: Array) -> list[tuple[Array, Array]]:
    """As `Timed` has it, of any field: one that does not know of moments is the same at all."""
    if isinstance(field, Timed):
        return field.at_moments(places, moments_s)
    return [(field.mean(places), field.sd(places))] * len(moments_s)


class Method(Protocol):
    """A way to make a field of readings; a frozen value with its own settings."""

    @property
    def key(self) -> str:
        """A short name for files."""
        ...

    @property
    def label(self) -> str:
        """A name for people."""
        ...

    def fit(self, readings: Readings, domain: Domain) -> Field:
        """Fit to readings. Raises `ValueError` where they do not determine a field."""
        ...
