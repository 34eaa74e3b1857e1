"""The limnological map F (remark 11), one quantity at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely
from scipy.special import ndtr

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities, Quantity
from grebe.core.samples import Flag, Samples
from grebe.mapping.drift import DriftFunction
from grebe.mapping.grid import Grid
from grebe.mapping.kriging import distinct
from grebe.mapping.likelihood import fit_reml
from grebe.mapping.methods import (
    Interpolator,
    Kriging,
    Method,
    ShoreInterpolator,
    blocked_share,
    chosen_method,
)
from grebe.mapping.noise import noise_variance
from grebe.mapping.spde import Mesh, coarse_mesh, fit_spde
from grebe.mapping.validation import Validation, validate
from grebe.mapping.variogram import Estimator, VariogramFit, fit_variogram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FEWEST_SAMPLES = 10
# A mean squared standardised error beyond this is not chance.
CLEAR_MSDR = 1.2
SHORE_REASON = "range and noise by restricted likelihood on the water's mesh"
CHOSEN = "of the two ways to fit, this one predicts left-out samples better"
# With fewer samples there is nothing to choose a fit by.
FEWEST_FOR_CHOICE = 20


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """How maps are made where the choice is not left to the data: None chooses.

    The covariance is fitted by restricted likelihood and to the variogram, unless one is asked
    for, and what predicts left-out lines better is taken. `drift` is what the mean depends on
    besides a constant; with it the method is kriging.
    """

    method: Method | None = None
    variogram: Literal["wls", "reml"] | None = None
    estimator: Estimator = "matheron"
    drift: DriftFunction | None = None

    def __post_init__(self) -> None:
        if self.drift is not None and self.method == "spde":
            raise InputError("A drift goes with --method kriging; the spde has a constant mean.")


@dataclass(frozen=True, kw_only=True)
class QuantityMap:
    """The map of one quantity: `mean` and `sd` of the water, (rows, columns), NaN on land;
    how it was made and what it is worth.

    `micro_sd`, of what varies within metres, is part of `sd`; a sensor's `noise_sd` is not.
    `widening` is the factor that cross-validation put on the standard deviations. `positions`
    and `values` are the samples that made the map.
    """

    quantity: Quantity
    grid: Grid
    mean: Array
    sd: Array
    widening: float
    micro_sd: float
    interpolator: Interpolator
    method: Method
    reason: str
    fit: VariogramFit
    validation: Validation | None
    positions: Array
    values: Array
    flagged: int

    @property
    def samples(self) -> int:
        """Number of samples that made the map."""
        return len(self.values)

    @property
    def noise_sd(self) -> float:
        """Standard deviation of an observation about the water."""
        nugget = self.widening**2 * self.interpolator.model.nugget
        return float(np.sqrt(max(nugget - self.micro_sd**2, 0.0)))

    def exceedance(self, threshold: float) -> Array:
        """Probability that the water lies above a threshold, (rows, columns); NaN on land."""
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (self.mean - threshold) / self.sd
        certain = (self.mean > threshold).astype(float)
        probability = np.where(self.sd > 0, ndtr(z), certain)
        return np.where(np.isfinite(self.mean), probability, np.nan)

    def draws(self, count: int, seed: int = 0) -> Array:
        """Equally likely fields given the samples, (count, rows, columns); NaN on land."""
        drawn = self.interpolator.draws(self.positions, self.values, self.grid, count, seed)
        fields = np.array([self.grid.spread(one) for one in drawn])
        fine = np.random.default_rng([seed, 1]).normal(0.0, self.micro_sd, fields.shape)
        return self.mean + self.widening * (fields - self.mean) + fine


@dataclass
class Mapper:
    """Maps the quantities of one survey: the water's grid and mesh are made once."""

    water: shapely.Polygon
    grid: Grid
    settings: MapSettings = field(default_factory=MapSettings)
    _shared: tuple[Mesh, Mesh] | None = field(init=False, default=None)

    def map_quantity(
        self, quantity: Quantity, positions: Array, values: Array, flags: NDArray[np.int64]
    ) -> QuantityMap:
        """Map one quantity from its samples; those flagged suspect or failed stay out of it.

        Raises `InputError` when fewer than `FEWEST_SAMPLES` good samples are left.
        """
        present = np.isfinite(values)
        good = present & np.isin(flags, Flag.USABLE)
        if good.sum() < FEWEST_SAMPLES:
            raise InputError(
                f"{quantity.label}: {int(good.sum())} good samples; a map needs {FEWEST_SAMPLES}."
            )
        at, data = distinct(positions[good], values[good])
        try:
            first = fit_variogram(at, self._detrended(at, data), self.settings.estimator)
            method, reason = self._method(at, data, first)
            fit, interpolator, validation = self._best(method, at, data, first)
        except ValueError as error:
            raise InputError(f"{quantity.label}: {error}.") from None
        estimate = interpolator.estimate(at, data, self.grid.nodes)
        widening = _widening(validation)
        nugget = interpolator.model.nugget
        micro_sd = widening * float(np.sqrt(nugget - noise_variance(at, data, nugget)))
        # What is finer than the sensor resolves is not known either.
        micro_sd = float(np.hypot(micro_sd, quantity.resolution / np.sqrt(12)))
        return QuantityMap(
            quantity=quantity,
            grid=self.grid,
            mean=self.grid.spread(estimate.mean),
            sd=self.grid.spread(np.hypot(widening * estimate.sd, micro_sd)),
            widening=widening,
            micro_sd=micro_sd,
            interpolator=interpolator,
            method=method,
            reason=reason,
            fit=fit,
            validation=validation,
            positions=at,
            values=data,
            flagged=int((present & ~good).sum()),
        )

    def _detrended(self, at: Array, data: Array) -> Array:
        """What a drift leaves, where there is one."""
        if self.settings.drift is not None:
            basis = np.column_stack([np.ones(len(at)), self.settings.drift(at)])
            data = data - basis @ np.linalg.lstsq(basis, data, rcond=None)[0]
        return data

    def _fits(self, at: Array, data: Array, first: VariogramFit) -> list[VariogramFit]:
        """The covariances to choose from, the one that was fitted to the variogram given."""
        asked = self.settings.variogram
        if asked == "wls" or first.model.sill == 0 or np.ptp(data) == 0:
            return [first]
        likeliest = fit_reml(at, self._detrended(at, data), self.settings.estimator)
        few = len(data) < FEWEST_FOR_CHOICE
        return [likeliest] if asked == "reml" or few else [likeliest, first]

    def _method(self, at: Array, data: Array, fit: VariogramFit) -> tuple[Method, str]:
        if self.settings.method is not None:
            return self.settings.method, "as asked"
        if self.settings.drift is not None:
            return "kriging", "a drift is asked for"
        if fit.model.sill == 0 or np.ptp(data) == 0:
            return "kriging", "nothing varies between places"
        reach = fit.model.practical_range_m
        return chosen_method(blocked_share(self.water, at, self.grid.nodes, reach))

    def _best(
        self, method: Method, at: Array, data: Array, first: VariogramFit
    ) -> tuple[VariogramFit, Interpolator, Validation | None]:
        """The fit that predicts the left-out lines best, with its interpolator and the proof.

        A field that knows the shore is validated on the coarse mesh, to save time.
        """
        if method == "spde":
            mesh, coarse = self._meshes()
            model = fit_spde(coarse, at, data)
            proof = validate(at, data, ShoreInterpolator(model=model, mesh=coarse))
            fit = replace(first, standard_errors={}, reason=SHORE_REASON)
            return fit, ShoreInterpolator(model=model, mesh=mesh), proof
        tried: list[tuple[VariogramFit, Interpolator, Validation | None]] = []
        for fit in self._fits(at, data, first):
            kriging = Kriging(model=fit.model, drift=self.settings.drift)
            tried.append((fit, kriging, validate(at, data, kriging)))
        best = min(tried, key=lambda one: np.inf if one[2] is None else one[2].score)
        if len(tried) > 1 and best[2] is not None:
            chosen = replace(best[0], reason=f"{best[0].reason}; {CHOSEN}")
            best = (chosen, best[1], best[2])
        return best

    def _meshes(self) -> tuple[Mesh, Mesh]:
        if self._shared is None:
            self._shared = Mesh(self.grid, self.water), coarse_mesh(self.water)
        return self._shared


def _widening(validation: Validation | None) -> float:
    """Factor of the standard deviations: what the left-out lines say of them, if it is clear.

    A sensor's samples along one line agree better than two lines do, and a covariance fitted
    to both believes the former.
    """
    if validation is None or validation.msdr <= CLEAR_MSDR:
        return 1.0
    return float(np.sqrt(validation.msdr))


def map_all(
    mapper: Mapper,
    samples: Samples,
    quantities: Quantities,
    on_done: Callable[[int, int], None] | None = None,
) -> tuple[list[QuantityMap], list[str]]:
    """Map every quantity that can be mapped; return the maps and why others are left out.

    `on_done` is told after each quantity how many are done, and of how many.
    """
    maps: list[QuantityMap] = []
    left_out: list[str] = []
    wanted = [one for one in quantities.values() if one.mapped]
    for done, quantity in enumerate(wanted, start=1):
        key = quantity.key
        try:
            if samples.measured(key):
                values, flags = samples.values[key], samples.flags[key]
                maps.append(mapper.map_quantity(quantity, samples.positions, values, flags))
            else:
                left_out.append(f"{quantity.label}: not measured")
        except InputError as error:
            left_out.append(str(error).rstrip("."))
        if on_done is not None:
            on_done(done, len(wanted))
    return maps, left_out
