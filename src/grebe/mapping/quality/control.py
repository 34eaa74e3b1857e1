"""Quality control of samples: QARTOD's tests, run by ioos_qc, and tests for a survey boat.

Nothing is deleted. Each value gets a flag (1 good, 3 suspect, 4 failed, 9 missing), the worst of
its tests; suspect and failed values are left out of the map. ioos_qc runs gross range, spike, flat
line and rate of change (IOOS QARTOD manuals), with wider limits for a noisy sensor. The others are
location (outside the water), time (going back), a sonde that is still settling after it was put in,
a sonde that repeats itself, samples out of the water, bubbles in the conductivity cell, and
excursions to values that are not the water's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.counts import counted
from grebe.core.quantities import BUILTIN, Limits, Quantities, Quantity
from grebe.core.samples import Flag, Samples
from grebe.mapping.quality.bubbles import bubbles
from grebe.mapping.quality.excursions import excursions
from grebe.mapping.quality.settling import settling_times
from grebe.mapping.quality.stuck import stuck
from grebe.mapping.stamps import spread_times

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Flags = NDArray[np.int64]

# If a position is farther than this beyond the shore, it or the outline is wrong [m].
OUTSIDE_M = 25.0
# A gap this many times as long as the usual interval is reported.
GAP_FACTOR = 10.0
# How many times slower the flat line test's clock runs; the fastest sonde that can be tested [s].
SLOWED, FASTEST_S = 100, 0.02
# Noise is estimated from at least this many samples.
FEWEST_SAMPLES = 30
# A spike or step that noise alone can explain, up to five standard deviations of it, is none. A
# spike is the lesser of two steps, a step the difference of two readings.
SPIKE_NOISE = 5.0
RATE_NOISE = 5.0 * math.sqrt(2.0)
# The other sensors bear witness to a bubble in a conductivity cell, except the sonde's depth.
WITHOUT_WITNESS = frozenset({"sonde_depth_m"})
# At most this share of depth readings are echoes from below the bed; the bed is no deeper than this
# quantile of the others.
MOST_AWAY, DEEPEST_SHARE = 0.2, 0.99
# A record whose smallest step is this many times its sensor's is too coarse to show a stuck sensor.
COARSE_STEPS = 2.5
# In air, the conductivity falls to nearly nothing at once, by this factor from one sample to the
# next; an inflow lowers it gradually.
ABRUPT = 3.0
# Samples this near in time to one in the air are suspect too [s].
SPLASH_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Flags (n,) of each quantity; for each quantity and test, how many values it found suspect and
    failed; and `notes` on the whole record.
    """

    flags: dict[str, Flags]
    counts: dict[str, dict[str, tuple[int, int]]]
    notes: tuple[str, ...] = field(default=())


def check_quality(
    samples: Samples, water: shapely.Polygon, quantities: Quantities = BUILTIN
) -> Quality:
    """Flag each value of the samples, in the order in which they were taken, by the limits of
    `quantities`.

    Existing flags are ignored. Raises `InputError` if a quantity is unknown.
    """
    shared = {"location": _location(samples, water), "time": _time(samples.times)}
    notes = _notes(samples.times)
    samples = replace(samples, times=spread_times(samples.times))
    air = _out_of_water(samples, quantities)
    settled, bubbly = _settled(samples, quantities), _bubbly(samples, quantities)
    still = _stuck(samples, quantities)
    since = samples.times - samples.times.min(initial=np.inf)
    flags: dict[str, Flags] = {}
    counts: dict[str, dict[str, tuple[int, int]]] = {}
    for key, column in samples.values.items():
        quantity = quantities.known(key)
        present = np.isfinite(column)
        flags[key] = np.where(present, Flag.GOOD, Flag.MISSING).astype(np.int64)
        if not present.any():
            continue
        common = dict(shared)
        if quantity.on_sonde:
            common |= {"out of water": air, "settling": _until(since, settled.get(key, -np.inf))}
            common["stuck sonde"] = still
        if key in bubbly:
            common["bubbles"] = np.where(bubbly[key], Flag.SUSPECT, Flag.GOOD)
        tests = {name: one[present] for name, one in common.items()}
        tests |= _tests(column[present], samples.times[present], quantity)
        worst = np.max([np.where(_bad(one), one, Flag.GOOD) for one in tests.values()], axis=0)
        flags[key][present] = worst
        counts[key] = {
            name: (int(np.sum(one == Flag.SUSPECT)), int(np.sum(one == Flag.FAIL)))
            for name, one in tests.items()
        }
    return Quality(flags=flags, counts=counts, notes=notes)


def _settled(samples: Samples, quantities: Quantities) -> dict[str, float]:
    """How long each sensor on the sonde took to settle [s]."""
    held = {key: one for key, one in samples.values.items() if quantities.known(key).on_sonde}
    return settling_times(held, samples.times, samples.positions)


def _until(since: Array, settled_s: float) -> Flags:
    return np.where(since <= settled_s, Flag.SUSPECT, Flag.GOOD)


def _bubbly(samples: Samples, quantities: Quantities) -> dict[str, NDArray[np.bool_]]:
    """Readings with a bubble in the cell, for each quantity that can detect air."""
    cell = [key for key in samples.values if quantities.known(key).air_share is not None]
    others = [
        column
        for key, column in samples.values.items()
        if key not in cell and key not in WITHOUT_WITNESS and quantities.known(key).on_sonde
    ]
    return {key: bubbles(samples.values[key], others, samples.times) for key in cell}


def _stuck(samples: Samples, quantities: Quantities) -> Flags:
    """Flags that are failed where all sensors on the sonde repeat their last readings."""
    fine = [
        column
        for key, column in samples.values.items()
        if quantities.known(key).on_sonde and not _coarse(column, quantities.known(key))
    ]
    repeated = stuck(fine, samples.times, samples.positions)
    return np.where(repeated, Flag.FAIL, Flag.GOOD)


def _coarse(values: Array, quantity: Quantity) -> bool:
    """Whether a logger wrote so few digits that the record may stand still in any water."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return len(steps) > 0 and bool(steps.min() > COARSE_STEPS * quantity.resolution > 0)


def _noise(values: Array) -> float:
    """Standard deviation of a sensor's noise, from the median of its third differences, which
    neither a gradient nor an outlier affects.
    """
    if len(values) < FEWEST_SAMPLES:
        return 0.0
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / math.sqrt(20.0)


def _bad(flags: Flags) -> NDArray[np.bool_]:
    return (flags == Flag.SUSPECT) | (flags == Flag.FAIL)


def _tests(values: Array, times: Array, quantity: Quantity) -> dict[str, Flags]:
    """Run the tests of one quantity on its present values; a test without a limit is skipped."""
    qartod, limits = _qartod(), quantity.limits
    stamps = (1e9 * times).astype(np.int64).astype("datetime64[ns]")
    results: dict[str, Any] = {
        "gross range": qartod.gross_range_test(
            values, fail_span=limits.fail_span, suspect_span=_within(limits)
        )
    }
    if np.any(gone := np.asarray(results["gross range"]) == Flag.FAIL) and not gone.all():
        # A value out of range is no neighbour of those within it, so -9999 makes no spike.
        rest = _tests(values[~gone], times[~gone], quantity)
        return {name: _with(one, gone) for name, one in rest.items()} | {
            "gross range": np.asarray(results["gross range"]).astype(np.int64)
        }
    if len(values) > 2 and (step := float(np.median(np.diff(times)))) > FASTEST_S:
        noise = _noise(values)
        # The differential method does not flag the two neighbours of a spike.
        results["spike"] = qartod.spike_test(
            values,
            suspect_threshold=max(limits.spike_suspect, SPIKE_NOISE * noise),
            fail_threshold=max(limits.spike_fail, SPIKE_NOISE * noise),
            method="differential",
        )
        results["rate of change"] = qartod.rate_of_change_test(
            values, stamps, threshold=max(limits.rate_per_s, RATE_NOISE * noise / step)
        )
        if math.isfinite(limits.flat_suspect_s + limits.flat_fail_s):
            # The test counts whole seconds, but a sonde may be faster: slow its clock down.
            slowed = (SLOWED * 1e9 * (times - times[0])).astype(np.int64).astype("datetime64[ns]")
            results["flat line"] = qartod.flat_line_test(
                values,
                slowed,
                suspect_threshold=int(SLOWED * limits.flat_suspect_s),
                fail_threshold=int(SLOWED * limits.flat_fail_s),
                tolerance=limits.flat_tolerance,
            )
            results["flat line"] = _from_the_beginning(results["flat line"], values, quantity)
        if math.isfinite(limits.spike_fail):
            step = max(limits.spike_fail, SPIKE_NOISE * noise)
            jumps = _bad(np.asarray(results["rate of change"])) | _bad(np.asarray(results["spike"]))
            away = _elsewhere(values, times, jumps, step, quantity)
            results["excursion"] = np.where(away, Flag.SUSPECT, Flag.GOOD)
    return {
        name: np.ma.filled(np.ma.asarray(one), Flag.NOT_EVALUATED).astype(np.int64)
        for name, one in results.items()
    }


def _elsewhere(
    values: Array, times: Array, jumps: NDArray[np.bool_], step: float, quantity: Quantity
) -> NDArray[np.bool_]:
    """Which readings (n,) are on an excursion that is not water. For a sensor on the sonde, an
    excursion at a single value, as of a sensor that has dropped out; a plume would vary. For a
    depth, an excursion's readings below the bed.
    """
    away = excursions(values, times, jumps, step)
    if not away.any() or (not quantity.on_sonde and away.mean() > MOST_AWAY):
        return np.zeros(len(values), dtype=bool)
    steady = ~(away | jumps)
    deep = float(np.quantile(values[steady], DEEPEST_SHARE)) if steady.any() else np.inf
    if not quantity.on_sonde:
        return away & (values > deep)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], away.astype(int), [0]])))
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        part = values[first:end]
        still = part[~jumps[first:end]] if not jumps[first:end].all() else part
        away[first:end] = np.ptp(still) <= quantity.resolution
    return away


def _from_the_beginning(flags: Any, values: Array, quantity: Quantity) -> Flags:
    """Flags of a flat line, with its worst from its beginning, because a stuck sensor was stuck at
    once. If a logger writes fewer digits than its sensor has, its record may well stand still, and
    the flags are left unchanged.
    """
    flags = np.ma.filled(np.ma.asarray(flags), Flag.NOT_EVALUATED).astype(np.int64)
    if _coarse(values, quantity):
        return flags
    moves = np.flatnonzero(np.abs(np.diff(values)) > quantity.limits.flat_tolerance) + 1
    for part in np.split(np.arange(len(values)), moves):
        if len(part) and np.any(_bad(flags[part])):
            flags[part] = np.max(flags[part][_bad(flags[part])])
    return flags


def _with(flags: Flags, gone: NDArray[np.bool_]) -> Flags:
    """Flags of a test from which some values were excluded."""
    whole = np.full(len(gone), Flag.NOT_EVALUATED, dtype=np.int64)
    whole[~gone] = flags
    return whole


def _qartod() -> Any:
    """IOOS's tests, imported only when they are run; their type annotations do not cover arrays."""
    from ioos_qc import qartod

    return qartod


def _within(limits: Limits) -> tuple[float, float]:
    """The suspect span, no wider than the failing one."""
    low, high = limits.suspect_span
    return max(low, limits.fail_span[0]), min(high, limits.fail_span[1])


def _location(samples: Samples, water: shapely.Polygon) -> Flags:
    away = shapely.distance(water, shapely.points(samples.positions))
    return np.where(away <= OUTSIDE_M, Flag.GOOD, Flag.FAIL)


def _time(times: Array) -> Flags:
    flags = np.full(len(times), Flag.GOOD)
    latest = np.maximum.accumulate(times)
    flags[1:][times[1:] < latest[:-1]] = Flag.FAIL
    return flags


def _notes(times: Array) -> tuple[str, ...]:
    steps = np.diff(times)
    forward = steps[steps > 0]
    if not len(forward):
        return ()
    usual = float(np.median(forward))
    gaps = forward[forward > GAP_FACTOR * usual]
    if not len(gaps):
        return ()
    which = "of" if len(gaps) == 1 else "the longest of"
    return (f"{counted(len(gaps), 'gap')} in time, {which} {gaps.max():.0f} s",)


def _out_of_water(samples: Samples, quantities: Quantities) -> Flags:
    """Flags that are failed where a sensor that can detect air is in the air, and suspect just
    before and after.
    """
    flags = np.full(len(samples), Flag.GOOD)
    for key in samples.values:
        share = quantities.known(key).air_share
        if share is not None and samples.measured(key):
            flags = np.maximum(flags, _in_the_air(samples.values[key], samples.times, share))
    return flags


def _in_the_air(column: Array, times: Array, share: float) -> Flags:
    flags = np.full(len(times), Flag.GOOD)
    air = _abrupt(column, column < share * float(np.nanmedian(column)))
    if air.any():
        moments = np.sort(times[air])
        after = np.searchsorted(moments, times)
        gap = np.minimum(
            np.abs(times - moments[np.clip(after, 0, len(moments) - 1)]),
            np.abs(times - moments[np.clip(after - 1, 0, len(moments) - 1)]),
        )
        flags[gap <= SPLASH_S] = Flag.SUSPECT
        flags[air] = Flag.FAIL
    return flags


def _abrupt(column: Array, low: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The runs of low values that begin or end with a jump."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    found = np.zeros(len(low), dtype=bool)
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        into = first > 0 and column[first - 1] > ABRUPT * column[first]
        out = end < len(column) and column[end] > ABRUPT * column[end - 1]
        found[first:end] = into or out or end - first == len(column)
    return found
