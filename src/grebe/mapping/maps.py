"""The limnological map F (remark 11), one quantity at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities, Quantity
from grebe.core.samples import Flag, Samples
from grebe.mapping.bathymetry import WATER_DEPTH
from grebe.mapping.calibration import Calibration, for_few, spread
from grebe.mapping.change import Change, fit_change, no_change
from grebe.mapping.grid import Grid
from grebe.mapping.kriging import distinct
from grebe.mapping.methods.base import Domain, Field, Method, Model, Readings
from grebe.mapping.methods.choice import ByShore, Choice
from grebe.mapping.methods.passes import Passes
from grebe.mapping.methods.shore import WithShore
from grebe.mapping.noise import noise_variance
from grebe.mapping.scale import LINEAR, Scale, exceedance, scale_of
from grebe.mapping.threads import one_blas_thread
from grebe.mapping.validation import (
    STRETCH_M,
    Z95,
    Validation,
    predicted,
    prove,
    stretch_folds,
)
from grebe.mapping.way import half_cell_m

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FEWEST_SAMPLES = 10
# Of more readings a share proves the map: along a way they lie closer than what is left out is
# wide, and more of them tell the same.
MOST_FOR_PROOF = 1_000
CHOSEN = "this one predicts left-out samples better"


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """How maps are made.

    `method`: a method, or several of which the one that predicts left-out samples best is taken;
    None leaves it to `choice`. `change`: how it is found out what changed while the readings were
    taken. `moment` [unix s], or the middle of the survey: the map shows the water then, without
    what changed everywhere and without the sensor's lag; None leaves each place as it was
    measured. `scale`: that on which a quantity is mapped; None takes the logarithm of what is
    positive and skewed. `shore_depth_sd_m`: the depth of the water is taken as zero along the
    shore, with this standard deviation [m]; None says nothing of the shore.
    """

    method: Method | tuple[Method, ...] | None = None
    choice: Choice = field(default_factory=ByShore)
    change: Callable[[Readings, float | None], Change] = fit_change
    moment: float | Literal["middle"] | None = None
    scale: Scale | None = None
    shore_depth_sd_m: float | None = None

    def __post_init__(self) -> None:
        sd = self.shore_depth_sd_m
        if sd is not None and not (np.isfinite(sd) and sd > 0):
            raise InputError(f"shore_depth_sd_m must be above 0 m, not {sd}.")

    def methods(self, readings: Readings, domain: Domain) -> tuple[tuple[Method, ...], str]:
        """The methods to try on some readings, and why these."""
        if self.method is None:
            return self.choice(readings, domain)
        several = self.method if isinstance(self.method, tuple) else (self.method,)
        return several, "as asked"


@dataclass(frozen=True, kw_only=True)
class PlaceValues:
    """The water at n places: `mean`, `sd`, and the ends of its 95 % interval, (n,)."""

    mean: Array
    sd: Array
    low: Array
    high: Array


@dataclass(frozen=True, kw_only=True)
class QuantityMap:
    """The map of one quantity: `mean` and `sd` of the water, (rows, columns), NaN on land;
    how it was made and what it is worth.

    `field` answers at any place, before the calibration; `model` is what it is made of, with the
    reason for it.

    `micro_sd`, of what varies within metres, is part of `sd`; a sensor's `noise_sd` is not.
    `calibration` are the factors that left-out stretches and lines put on the standard deviations.
    `change` is what all of the water changed by, and how late the sensor was. `is_of_moment`: both
    are taken out, and the map is of `change.moment_s`; if not, each place is as it was when the
    boat was near. `readings` made the map, brought to its moment.

    `mean` and `sd`, and what the properties say, are in the quantity's unit. What the map was made
    of - `field`, `model`, `readings`, `change`, `micro_sd` - is on its `scale`, and there the water
    is normal about `on_scale`, mean and standard deviation; None where that is `mean` and `sd`.
    """

    quantity: Quantity
    grid: Grid
    mean: Array
    sd: Array
    calibration: Calibration
    micro_sd: float
    change: Change
    is_of_moment: bool
    readings: Readings
    field: Field
    method: Method
    reason: str
    model: Model
    validation: Validation | None
    flagged: int
    scale: Scale = LINEAR
    on_scale: tuple[Array, Array] | None = None

    @property
    def positions(self) -> Array:
        """Where the samples were taken that made the map, (n, 2) [m]."""
        return self.readings.positions

    @property
    def values(self) -> Array:
        """Their values (n,), brought to the map's moment where it has one."""
        return self.scale.back(self.readings.values)

    @property
    def samples(self) -> int:
        """Number of samples that made the map."""
        return len(self.values)

    @property
    def noise_sd(self) -> float:
        """Standard deviation of an observation about the water, where that is as in the middle."""
        nugget = self.calibration.on_way**2 * self.model.nugget
        return self.in_unit(float(np.sqrt(max(nugget - self.micro_sd**2, 0.0))))

    @property
    def changed_by(self) -> float:
        """By how much all of the water changed during the survey, where it is as in the middle."""
        return self.in_unit(self.change.range_of)

    @property
    def error95(self) -> float:
        """Half the width of the 95 % interval of the median place."""
        if self.on_scale is None:
            return Z95 * float(np.median(self.sd[self.grid.inside]))
        mean, sd = (one[self.grid.inside] for one in self.on_scale)
        width = self.scale.back(mean + Z95 * sd) - self.scale.back(mean - Z95 * sd)
        return float(np.median(width)) / 2

    def in_unit(self, step: float) -> float:
        """What a small step on the map's scale is in the quantity's unit, at the map's median."""
        return step * self.scale.slope(float(np.nanmedian(self.mean)))

    def at(self, places: Array) -> PlaceValues:
        """What is known of places (n, 2) [m]."""
        mean, sd = self.field.mean(places), self.field.sd(places)
        sd = np.hypot(self.calibration.factor(places) * sd, self.micro_sd)
        low, high = (self.scale.back(mean + z * sd) for z in (-Z95, Z95))
        known = known_sd(sd, self.readings)
        return PlaceValues(
            mean=self.scale.mean(mean, known), sd=self.scale.sd(mean, sd), low=low, high=high
        )

    def exceedance(self, threshold: float) -> Array:
        """Probability that the water lies above a threshold, (rows, columns); NaN on land."""
        mean, sd = self.on_scale or (self.mean, self.sd)
        return exceedance(self.scale, mean, sd, threshold)

    def draws(self, count: int, seed: int = 0) -> Array:
        """Equally likely fields given the samples, (count, rows, columns); NaN on land."""
        drawn = self.draws_at_nodes(count, 1, seed)
        return np.array([self.grid.spread(one) for one in drawn])

    def draws_at_nodes(self, count: int, every: int = 1, seed: int = 0) -> Array:
        """Equally likely values given the samples at every so many of the grid's nodes in the
        water, (count, m).
        """
        nodes, inside = self.grid.nodes[::every], self.grid.inside
        mean, _ = self.on_scale or (self.mean, self.sd)
        mean = mean[inside][::every]
        with one_blas_thread():
            drawn = self.field.draws(nodes, count, seed)
        fine = np.random.default_rng([seed, 1]).normal(0.0, self.micro_sd, drawn.shape)
        drawn = mean + self.calibration.factor(nodes) * (drawn - mean) + fine
        if self.is_of_moment:
            drawn = drawn + self.change.draws_near(self.readings, nodes, count, seed)
        return self.scale.back(drawn)


@dataclass
class Mapper:
    """Maps the quantities of one survey: the water's grid and mesh are made once."""

    water: shapely.Polygon
    grid: Grid
    settings: MapSettings = field(default_factory=MapSettings)

    def __post_init__(self) -> None:
        self._domain = Domain(self.water, self.grid)

    def map_quantity(
        self,
        quantity: Quantity,
        positions: Array,
        values: Array,
        flags: NDArray[np.int64],
        times: Array | None = None,
    ) -> QuantityMap:
        """Map one quantity from its samples; those flagged suspect or failed stay out of it.
        Without `times` (n,) [unix s] nothing is known of changes during the survey.

        Raises `InputError` when fewer than `FEWEST_SAMPLES` good samples are left.
        """
        present = np.isfinite(values)
        good = present & np.isin(flags, Flag.USABLE)
        if good.sum() < FEWEST_SAMPLES:
            raise InputError(
                f"{quantity.label}: {int(good.sum())} good samples; a map needs {FEWEST_SAMPLES}."
            )
        once = distinct(positions[good], values[good])
        readings = Readings(
            positions=positions[good][once],
            values=values[good][once],
            times=None if times is None else times[good][once],
        )
        flagged = int((present & ~good).sum())
        with one_blas_thread():
            try:
                return self._mapped(quantity, readings, flagged)
            except ValueError as error:
                raise InputError(f"{quantity.label}: {error}.") from None

    def _mapped(self, quantity: Quantity, readings: Readings, flagged: int) -> QuantityMap:
        moment = self.settings.moment
        if moment is not None and readings.times is None:
            raise ValueError("a map of one moment needs the times of the samples")
        # The bed stays as it is: passes over it differ by the sonar's errors alone.
        is_bed = quantity.key == WATER_DEPTH
        scale = self._scale(readings, is_bed=is_bed)
        readings = replace(readings, values=scale.forward(readings.values))
        if is_bed and moment is None:
            change = no_change(readings)
        else:
            change = self.settings.change(readings, None if moment == "middle" else moment)
        if moment is not None:
            readings = replace(change.reduced(change.placed(readings)), moment_s=change.moment_s)
        at, data = readings.positions, readings.values
        methods, reason = self.settings.methods(readings, self._domain)
        if is_bed and self.settings.shore_depth_sd_m is not None:
            sd = self.settings.shore_depth_sd_m
            methods = tuple(WithShore(method=one, sd=sd) for one in methods)
        asked_for = any(one.key == Passes.key for one in methods)
        still = is_bed and not asked_for
        told = replace(readings, times=None) if still else readings
        found = best_of(methods, told, self._domain, scale)
        model, factors = found.model, found.calibration
        noise = noise_variance(at, data, model.nugget)
        micro_sd = factors.on_way * float(np.sqrt(model.nugget - noise))
        # What is finer than the sensor resolves is not known either.
        slope = scale.slope(float(np.median(scale.back(data))))
        micro_sd = float(np.hypot(micro_sd, quantity.resolution / slope / np.sqrt(12)))
        nodes = self.grid.nodes
        mean = found.field.mean(nodes)
        sd = np.hypot(factors.factor(nodes) * found.field.sd(nodes), micro_sd)
        if moment is not None:
            sd = np.hypot(sd, change.sd_near(readings, nodes))
        return QuantityMap(
            quantity=quantity,
            grid=self.grid,
            mean=self.grid.spread(scale.mean(mean, known_sd(sd, readings))),
            sd=self.grid.spread(scale.sd(mean, sd)),
            calibration=factors,
            micro_sd=micro_sd,
            change=change,
            is_of_moment=moment is not None,
            readings=readings,
            field=found.field,
            method=found.method,
            reason=reason,
            model=model,
            validation=found.validation,
            flagged=flagged,
            scale=scale,
            on_scale=None if scale is LINEAR else (self.grid.spread(mean), self.grid.spread(sd)),
        )

    def _scale(self, readings: Readings, *, is_bed: bool) -> Scale:
        """The scale as asked, or as the readings have it; a bed is not carried by plumes."""
        asked = self.settings.scale
        if asked is None:
            return LINEAR if is_bed else scale_of(readings.positions, readings.values)
        if asked is not LINEAR and float(readings.values.min()) <= 0:
            raise ValueError("the logarithm needs readings above 0, and there are others")
        return asked


def known_sd(sd: Array, readings: Readings) -> Array:
    """What of a standard deviation counts for the mean of a skewed quantity: at most that of the
    readings. An interval may be wider, for what is not known of the covariance; the water is not.
    """
    return np.minimum(sd, float(np.std(readings.values)))


@dataclass(frozen=True, kw_only=True)
class Best:
    """The method that predicts best, its field, what it is made of, and how far it is trusted."""

    method: Method
    field: Field
    model: Model
    calibration: Calibration
    validation: Validation | None


def best_of(
    methods: Sequence[Method], readings: Readings, domain: Domain, scale: Scale = LINEAR
) -> Best:
    """Fit each method and take the one that predicts best what is left out, stretches of the way
    of two lengths and whole lines. Where nothing can be left out it is the first.
    """
    tried = [_tried(one, readings, domain, scale) for one in methods]
    scores = [score for score, _ in tried]
    chosen = int(np.argmin(scores))
    best = tried[chosen][1]
    if max(scores) > scores[chosen]:
        ways = {2: "two", 3: "three"}.get(len(tried), str(len(tried)))
        text = f"{best.model.reason}; of the {ways} ways to fit, {CHOSEN}"
        return replace(best, model=replace(best.model, reason=text))
    return best


def _tried(method: Method, readings: Readings, domain: Domain, scale: Scale) -> tuple[float, Best]:
    """A fitted method, and the geometric mean of its errors at several distances."""
    found = method.fit(readings, domain)
    way = readings.positions
    readings = readings.part(np.arange(len(readings)) % _every(len(readings)) == 0)
    proof = prove(readings, found, scale=scale)
    if proof is None:
        return np.inf, Best(
            method=method, field=found, model=found.model, calibration=Calibration(),
            validation=None,
        )  # fmt: skip
    positions = readings.positions
    near = [predicted(readings, found, stretch_folds(positions, side)) for side in STRETCH_M]
    validation, far = proof
    stretches = [int(np.ptp(positions, axis=0).sum() / side) + 1 for side in STRETCH_M]
    on_way = [spread(one, count) for one, count in zip(near, stretches, strict=True)]
    calibration = Calibration(
        on_way=float(np.exp(np.mean(np.log(on_way)))),
        # Off the way there is less to tell by: no map is made surer there than its model is.
        off_way=max(spread(far, validation.pieces) * for_few(validation.pieces), 1.0),
        way=way,
        wide_m=half_cell_m(domain.grid.step_m),
    )
    told = [max(one.rmse, 1e-300) for one in (*near, far) if len(one.error)]
    score = float(np.mean(np.log(told))) if told else np.inf
    return score, Best(
        method=method,
        field=found,
        model=found.model,
        calibration=calibration,
        validation=validation,
    )


def _every(count: int) -> int:
    """Which of so many readings prove the map: every first, second, third ..."""
    return -(-count // MOST_FOR_PROOF)


def _refuse_moment(moment: float | Literal["middle"] | None, times: Array) -> None:
    """Nothing is known of the water at a time when nobody measured."""
    if moment is None or moment == "middle" or not len(times):
        return
    first, last = float(times.min()), float(times.max())
    if not first <= moment <= last:
        asked, begun, ended = (
            datetime.fromtimestamp(one, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
            for one in (moment, first, last)
        )
        raise InputError(
            f"No sample was taken at {asked}; give a moment from {begun} to {ended}.",
            settings=("moment",),
        )


def map_all(
    mapper: Mapper,
    samples: Samples,
    quantities: Quantities,
    on_done: Callable[[int, int], None] | None = None,
) -> tuple[list[QuantityMap], list[str]]:
    """Map every quantity that can be mapped; return the maps and why others are left out.

    `on_done` is told after each quantity how many are done, and of how many. Raises `InputError`
    where a moment is asked for in which nobody measured.
    """
    _refuse_moment(mapper.settings.moment, samples.times)
    maps: list[QuantityMap] = []
    left_out: list[str] = []
    # What changed, and how late sensors were, is told by one boat's way over time.
    times = samples.times if samples.boat is None else None
    wanted = [one for one in quantities.values() if one.mapped]
    for done, quantity in enumerate(wanted, start=1):
        key = quantity.key
        try:
            if samples.measured(key):
                maps.append(
                    mapper.map_quantity(
                        quantity,
                        samples.positions,
                        samples.values[key],
                        samples.flags[key],
                        times,
                    )
                )
            else:
                left_out.append(f"{quantity.label}: not measured")
        except InputError as error:
            left_out.append(str(error).rstrip("."))
        if on_done is not None:
            on_done(done, len(wanted))
    return maps, left_out
