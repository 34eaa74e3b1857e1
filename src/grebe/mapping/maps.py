"""The limnological map F (remark 11), one quantity at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities, Quantity
from grebe.core.samples import Flag, Samples
from grebe.mapping.bathymetry import WATER_DEPTH
from grebe.mapping.change import Change, fit_change, no_change
from grebe.mapping.covariance.noise import noise_variance
from grebe.mapping.fields.joining import distinct
from grebe.mapping.grid import Grid
from grebe.mapping.methods.base import Domain, Method, Model, Readings
from grebe.mapping.methods.choice import ByShore, Choice, Straight
from grebe.mapping.methods.passes import Passes
from grebe.mapping.methods.shore import WithShore
from grebe.mapping.methods.together import Together
from grebe.mapping.proof.method_choice import Best, best_of
from grebe.mapping.quantity_map import QuantityMap, known_sd, possible, water_sd
from grebe.mapping.scale import LINEAR, Scale, scale_of
from grebe.mapping.stamps import spread_times
from grebe.mapping.threads import one_blas_thread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

A = TypeVar("A")
R = TypeVar("R")

# A map's time [unix s], or the middle of the survey.
Moment = float | Literal["middle"]
# Readings of other quantities, by key.
Beside = Sequence[tuple[str, Readings]]

FEWEST_SAMPLES = 10


class Each(Protocol):
    """Runs a task on each of several items."""

    def __call__(self, task: Callable[[A], R], items: Iterable[A], /) -> Iterator[R]:
        """Return the results in the order of the items."""
        ...


def in_turn(task: Callable[[A], R], items: Iterable[A], /) -> Iterator[R]:
    """Run the task on one item after the other; see `Each`."""
    return map(task, items)


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """How maps are made.

    `method`: a method, or several, of which the one that best predicts left-out samples is used;
    None leaves the choice to `choice`. `change`: the function that estimates what changed while
    the readings were taken. `moment`: a time [unix s], or "middle" for the middle of the survey.
    The map then shows the water at that time, with the change of all the water and the sensor's lag
    removed; None maps each place as it was measured. `scale`: the scale on which a quantity is
    mapped; None chooses the logarithm for positive, skewed quantities. `shore_depth_sd_m`: takes
    the water's depth as zero along the shore, with this standard deviation [m]; None assumes
    nothing about the shore. `together`: keys of quantities, each of which is mapped with the
    readings of the others as well.
    """

    method: Method | tuple[Method, ...] | None = None
    choice: Choice = field(default_factory=ByShore)
    change: Callable[[Readings, Moment | None], Change] = fit_change
    moment: Moment | None = None
    scale: Scale | None = None
    shore_depth_sd_m: float | None = None
    together: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        sd = self.shore_depth_sd_m
        if sd is not None and not (np.isfinite(sd) and sd > 0):
            raise InputError(f"shore_depth_sd_m must be above 0 m, not {sd}.")
        if self.together and len(set(self.together)) < 2:
            raise InputError(
                f"Mapping quantities together needs at least two, not {self.together[0]} alone.",
                settings=("together",),
            )

    def methods(self, readings: Readings, domain: Domain) -> tuple[tuple[Method, ...], str]:
        """Return the methods to try on some readings, and the reason for them."""
        if self.method is None:
            return self.choice(readings, domain)
        several = self.method if isinstance(self.method, tuple) else (self.method,)
        return several, "as asked"


@dataclass
class Mapper:
    """Maps the quantities of one survey; the water's grid and mesh are made once."""

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
        beside: Beside = (),
    ) -> QuantityMap:
        """Map one quantity from its samples, leaving out those flagged suspect or failed.

        Without `times` (n,) [unix s], changes during the survey cannot be estimated. `beside` holds
        the readings of the quantities to map it together with, as `companion` returns them.

        Raises `InputError` if fewer than `FEWEST_SAMPLES` good samples are left.
        """
        present = np.isfinite(values)
        good = present & np.isin(flags, Flag.USABLE)
        if good.sum() < FEWEST_SAMPLES:
            raise InputError(
                f"{quantity.label}: {int(good.sum())} good samples; a map needs {FEWEST_SAMPLES}."
            )
        readings = _readings(positions, values, times, good)
        flagged = int((present & ~good).sum())
        with one_blas_thread():
            try:
                return self._mapped(quantity, readings, flagged, beside)
            except ValueError as error:
                raise InputError(f"{quantity.label}: {error}.") from None

    def companion(
        self, quantity: Quantity, samples: Samples, times: Array | None
    ) -> Readings | None:
        """Return the readings of a quantity that others are mapped together with, on its scale and
        brought to the map's time; None if too few are good or all are equal.
        """
        good = samples.usable(quantity.key)
        values = samples.values[quantity.key]
        if good.sum() < FEWEST_SAMPLES or np.ptp(values[good]) == 0:
            return None
        is_bed = quantity.key == WATER_DEPTH
        return self._prepared(quantity, _readings(samples.positions, values, times, good), is_bed)[
            0
        ]

    def _prepared(
        self, quantity: Quantity, readings: Readings, is_bed: bool
    ) -> tuple[Readings, Scale, Change]:
        """Return the readings on their scale, brought to the map's time if it has one."""
        may_be_log = quantity.has_true_zero
        scale = self._scale(readings, is_bed=is_bed, may_be_log=may_be_log)
        readings = replace(readings, values=scale.forward(readings.values))
        change = self._change(readings, is_bed=is_bed)
        if self.settings.moment is not None:
            readings = replace(change.reduced(change.placed(readings)), moment_s=change.moment_s)
        return readings, scale, change

    def _mapped(
        self, quantity: Quantity, readings: Readings, flagged: int, beside: Beside
    ) -> QuantityMap:
        moment = self.settings.moment
        if moment is not None and readings.times is None:
            raise ValueError("a map of one moment needs samples with times")
        is_bed = quantity.key == WATER_DEPTH
        readings, scale, change = self._prepared(quantity, readings, is_bed)
        found, reason = self._best(readings, scale, beside, is_bed=is_bed)
        micro_sd = _micro_sd(found, readings, scale, quantity.resolution)
        nodes = self.grid.nodes
        mean = found.field.mean(nodes)
        sd = water_sd(found.field, found.calibration, micro_sd, nodes)
        if moment is not None:
            sd = np.hypot(sd, change.sd_near(readings, nodes))
        return QuantityMap(
            quantity=quantity,
            grid=self.grid,
            mean=self.grid.spread(
                possible(
                    scale.mean(mean, known_sd(sd, readings)), quantity, scale.back(readings.values)
                )
            ),
            sd=self.grid.spread(scale.sd(mean, sd)),
            calibration=found.calibration,
            micro_sd=micro_sd,
            change=change,
            is_of_moment=moment is not None,
            readings=readings,
            field=found.field,
            method=_used(found),
            reason=reason,
            model=found.model,
            validation=found.validation,
            flagged=flagged,
            scale=scale,
            on_scale=None if scale == LINEAR else (self.grid.spread(mean), self.grid.spread(sd)),
        )

    def _change(self, readings: Readings, *, is_bed: bool) -> Change:
        """Estimate what changed while the readings were taken. A lake bed does not change: passes
        over it differ only by the sonar's errors.
        """
        moment = self.settings.moment
        if is_bed and moment is None:
            return no_change(readings)
        return self.settings.change(readings, moment)

    def _best(
        self, readings: Readings, scale: Scale, beside: Beside, *, is_bed: bool
    ) -> tuple[Best, str]:
        """Return the method that predicts best, and the reason why it was tried."""
        # The densest readings decide whether land lies between: a sparse quantity follows them.
        densest = max((readings, *(one for _, one in beside)), key=len)
        methods, reason = self.settings.methods(densest, self._domain)
        if beside:
            # Mapping together uses straight-line distances: not where land lies between.
            methods = tuple(
                Together(beside=tuple(beside), alone=one) if isinstance(one, Straight) else one
                for one in methods
            )
        if is_bed and self.settings.shore_depth_sd_m is not None:
            sd = self.settings.shore_depth_sd_m
            methods = tuple(WithShore(method=one, sd=sd) for one in methods)
        asked_for = any(one.key == Passes.key for one in methods)
        still = is_bed and not asked_for
        told = replace(readings, times=None) if still else readings
        return best_of(methods, told, self._domain, scale), reason

    def _scale(self, readings: Readings, *, is_bed: bool, may_be_log: bool) -> Scale:
        """Return the scale that was set, or the one that suits the readings. A lake bed is always
        linear, because plumes do not carry it. So is a quantity whose zero is no limit, such as
        temperature, unless a scale is set.
        """
        asked = self.settings.scale
        if is_bed:
            return LINEAR
        if asked is None:
            return scale_of(readings.positions, readings.values) if may_be_log else LINEAR
        if asked != LINEAR and float(readings.values.min()) <= 0:
            raise ValueError("the logarithm needs readings above 0, but some are not")
        return asked


def _readings(
    positions: Array, values: Array, times: Array | None, good: NDArray[np.bool_]
) -> Readings:
    """Return the good samples, each once."""
    once = distinct(positions[good], values[good])
    return Readings(
        positions=positions[good][once],
        values=values[good][once],
        times=None if times is None else times[good][once],
    )


def _used(found: Best) -> Method:
    """Return the method that made the field: a quantity to which its companions add nothing is
    mapped alone.
    """
    told = found.model.companions
    if isinstance(found.method, Together) and told is not None and not told.heeded:
        return found.method.alone
    return found.method


def _micro_sd(found: Best, readings: Readings, scale: Scale, resolution: float) -> float:
    """Standard deviation of what varies within metres or is finer than the sensor's resolution."""
    nugget = found.model.nugget
    noise = noise_variance(readings.positions, readings.values, nugget)
    slope = scale.slope(float(np.median(scale.back(readings.values))))
    within_m = found.calibration.on_way * float(np.sqrt(nugget - noise))
    within_m = float(np.hypot(within_m, _sd_within(found.model, readings.spread_m)))
    return float(np.hypot(within_m, resolution / slope / np.sqrt(12)))


def _sd_within(model: Model, spread_m: float) -> float:
    """Standard deviation of the water about its mean over the stretch that a value comes from: the
    mean semivariance within that (Chiles and Delfiner 2012: dispersion variance).
    """
    if spread_m == 0 or model.semivariance is None:
        return 0.0
    varies = float(model.semivariance(np.array([spread_m]))[0]) - model.nugget
    return float(np.sqrt(max(varies, 0.0)))


def _refuse_moment(moment: Moment | None, times: Array) -> None:
    """Reject a time at which nobody measured: nothing is known of the water then."""
    if moment is None or moment == "middle" or not len(times):
        return
    first, last = float(times.min()), float(times.max())
    if not first <= moment <= last:
        asked, begun, ended = (
            datetime.fromtimestamp(one, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
            for one in (moment, first, last)
        )
        raise InputError(
            f"{asked} is outside the survey; give a moment from {begun} to {ended}.",
            settings=("moment",),
        )


def _refuse_together(together: Sequence[str], samples: Samples, quantities: Quantities) -> None:
    for key in together:
        if key not in quantities or not samples.measured(key):
            measured = [one for one in quantities if samples.measured(one)]
            raise InputError(
                f"{key} was not measured, so it cannot be mapped together with others; choose "
                f"from {', '.join(measured)}.",
                settings=("together",),
            )


def _beside(
    mapper: Mapper, samples: Samples, quantities: Quantities, key: str, times: Array | None
) -> Beside:
    """Return the readings of the quantities that this one is mapped together with."""
    together = mapper.settings.together
    others = [one for one in dict.fromkeys(together) if one != key and key in together]
    found = [(one, mapper.companion(quantities[one], samples, times)) for one in others]
    return [(one, readings) for one, readings in found if readings is not None]


@dataclass(frozen=True, kw_only=True, eq=False)
class _OneMap:
    """Makes the map of the quantity with the given key, or returns why there is none."""

    mapper: Mapper
    samples: Samples
    quantities: Quantities
    times: Array | None

    def __call__(self, key: str) -> QuantityMap | str:
        quantity, samples = self.quantities[key], self.samples
        if not samples.measured(key):
            return f"{quantity.label}: not measured"
        try:
            return self.mapper.map_quantity(
                quantity,
                samples.positions,
                samples.values[key],
                samples.flags[key],
                self.times,
                _beside(self.mapper, samples, self.quantities, key, self.times),
            )
        except InputError as error:
            return str(error).rstrip(".")


def map_all(
    mapper: Mapper,
    samples: Samples,
    quantities: Quantities,
    on_done: Callable[[int, int], None] | None = None,
    each: Each = in_turn,
) -> tuple[list[QuantityMap], list[str]]:
    """Map every quantity that can be mapped; return the maps, and why others were left out.

    `on_done` is called after each quantity with the number done and the total. `each` runs the
    task for every quantity, in this process or elsewhere; the maps are the same. Raises
    `InputError` if the requested time is outside the survey, or if a quantity to be mapped together
    with others was not measured.
    """
    _refuse_moment(mapper.settings.moment, samples.times)
    _refuse_together(mapper.settings.together, samples, quantities)
    if mapper.settings.moment == "middle" and len(samples):
        # The middle of the whole survey: the same for all quantities, whatever is flagged of each.
        middle = float(samples.times.min() + samples.times.max()) / 2
        mapper = replace(mapper, settings=replace(mapper.settings, moment=middle))
    maps: list[QuantityMap] = []
    left_out: list[str] = []
    # Changes and lags are estimated from the path of a single boat over time.
    times = spread_times(samples.times) if samples.boat is None else None
    wanted = [one.key for one in quantities.values() if one.mapped]
    task = _OneMap(mapper=mapper, samples=samples, quantities=quantities, times=times)
    for done, made in enumerate(each(task, wanted), start=1):
        if isinstance(made, str):
            left_out.append(made)
        else:
            # A map made in another process comes with its own copy of the grid.
            maps.append(replace(made, grid=mapper.grid))
        if on_done is not None:
            on_done(done, len(wanted))
    if not wanted:
        left_out = [f"{one.label}: not a property of the water" for one in quantities.values()]
    return maps, left_out
