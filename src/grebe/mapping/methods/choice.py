"""The built-in methods by name, and the choice among them if none is set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.mapping.covariance.likelihood import fit_reml
from grebe.mapping.covariance.posterior import fit_rough, fit_smooth
from grebe.mapping.covariance.variogram import fit_variogram
from grebe.mapping.methods.averaged import Averaged
from grebe.mapping.methods.base import Domain, Method, Readings
from grebe.mapping.methods.kriging import CovarianceFit, Kriging, first_fit
from grebe.mapping.methods.passes import Passes
from grebe.mapping.methods.spde import Spde

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

M = TypeVar("M", bound=Method)
# Methods that use straight-line distances only.
Straight = Kriging | Passes | Averaged

# Land matters if it crosses more than this share of the sight lines within the range.
BLOCKED_SHARE = 0.02
SIGHT_LINES = 2_000

COVARIANCE_FITS: Mapping[str, CovarianceFit] = MappingProxyType(
    {"rough": fit_rough, "smooth": fit_smooth, "reml": fit_reml, "wls": fit_variogram}
)
# The methods tried for kriging with a covariance of place alone: a rough covariance under priors,
# and the variogram's.
KRIGING: tuple[Kriging, ...] = tuple(
    Kriging(fit_covariance=COVARIANCE_FITS[name]) for name in ("rough", "wls")
)
# The default method.
AVERAGED = Averaged()
# For front ends. If there are several methods under a name, the one that best predicts left-out
# readings is used.
METHODS: Mapping[str, tuple[Method, ...]] = MappingProxyType(
    {"kriging": (AVERAGED,), "passes": (Passes(),), "spde": (Spde(),)}
)

# The methods to try on given readings, and the reason in a sentence.
Choice = Callable[[Readings, Domain], tuple[tuple[Method, ...], str]]


@dataclass(frozen=True, kw_only=True)
class ByShore:
    """Choose by whether land lies between the readings and the map: `straight` methods if it does
    not, `around` if it does.
    """

    straight: tuple[Straight, ...] = (AVERAGED,)
    around: tuple[Method, ...] = (Spde(),)

    def __call__(self, readings: Readings, domain: Domain) -> tuple[tuple[Method, ...], str]:
        """Return the methods to try, and why. Raises `ValueError` if there are too few pairs."""
        if any(one.drift is not None for one in self.straight):
            return self.straight, "a drift is asked for"
        first = self.straight[0]
        model = first_fit(readings, first.estimator, first.drift).model
        if model.sill == 0 or np.ptp(readings.values) == 0:
            return self.straight, "nothing varies between places"
        share = blocked_share(
            domain.outline, readings.positions, domain.grid.nodes, model.practical_range_m
        )
        if share > BLOCKED_SHARE:
            return self.around, f"land crosses {share:.0%} of the sight lines within the range"
        if share > 0:
            reason = f"land crosses only {share:.1%} of the sight lines within the range"
            return self.straight, reason
        return self.straight, "no land lies between the samples and the map"


def with_settings(methods: tuple[M, ...], **settings: object) -> tuple[M, ...]:
    """Replace settings of the methods; None leaves a setting unchanged.

    Raises `InputError` for a setting that a method does not have.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    made: list[M] = []
    for one in methods:
        known = {setting.name for setting in fields(cast(Any, one))}
        for name in given:
            if name not in known:
                raise InputError(
                    f"The method {one.key} has no setting {name!r}; choose another method."
                )
        changed = cast(M, replace(cast(Any, one), **given))
        if changed not in made:
            made.append(changed)
    return tuple(made)


def blocked_share(
    water: shapely.Polygon, positions: Array, nodes: Array, reach_m: float, seed: int = 0
) -> float:
    """Share of the straight lines, from samples to nodes within reach, that cross land."""
    rng = np.random.default_rng(seed)
    a = positions[rng.integers(len(positions), size=20 * SIGHT_LINES)]
    b = nodes[rng.integers(len(nodes), size=20 * SIGHT_LINES)]
    near = np.flatnonzero(np.hypot(*(a - b).T) <= reach_m)[:SIGHT_LINES]
    if not len(near):
        return 0.0
    shapely.prepare(water)
    # Samples may be a GPS error beyond the shore: their lines show nothing.
    near = near[shapely.intersects_xy(water, a[near])]
    lines = shapely.linestrings(np.stack([a[near], b[near]], axis=1))
    return float(1 - np.mean(shapely.covers(water, lines))) if len(near) else 0.0
