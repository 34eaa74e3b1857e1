"""Quality control of samples: QARTOD's tests by ioos_qc, and two of a survey boat's own.

Nothing is deleted: each value gets a flag (1 good, 3 suspect, 4 failed, 9 missing), the worst of
its tests, and only the good ones make the map. The tests: gross range, spike, flat line, rate
of change (IOOS QARTOD manuals), location (outside the water), time (going back), the sonde
settling after it was put in, and samples out of the water.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from scipy.optimize import least_squares

from grebe.core.quantities import BUILTIN, Limits, Quantities, Quantity
from grebe.core.samples import Flag, Samples

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Flags = NDArray[np.int64]

# Beyond the shore by more than this a position is wrong, or the outline is [m].
OUTSIDE_M = 25.0
# A gap this many times as long as the usual interval is told of.
GAP_FACTOR = 10.0
# So many times slower the clock of the flat line test goes; the fastest sonde that it can judge.
SLOWED, FASTEST_S = 100, 0.02
# The sonde settles within this time [s]; what comes later, up to that time, shows what is usual.
SETTLING_S, USUAL_S = 300.0, 1500.0
SETTLING_WINDOW_S = 100.0
FEWEST_SAMPLES = 30
# An exponential approach must explain so much of the first minutes, and be so much larger than
# what the record shows in as long a time later.
EXPLAINED, CLEAR_FACTOR = 0.9, 2.5
LONGEST_TAU_S = 150.0
# Settled: what is left of the approach.
SETTLED_SHARE = 0.05
# In the air the conductivity falls at once to nearly nothing, by this factor from one sample to
# the next; an inflow thins it by and by.
ABRUPT = 3.0
# Samples beside one in the air that are suspect as well [s].
SPLASH_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Flags (n,) of each quantity, and for each quantity and test the numbers of values that it
    found suspect and failed; `notes` on the whole record.
    """

    flags: dict[str, Flags]
    counts: dict[str, dict[str, tuple[int, int]]]
    notes: tuple[str, ...] = field(default=())


def check_quality(
    samples: Samples, water: shapely.Polygon, quantities: Quantities = BUILTIN
) -> Quality:
    """Flag each value of some samples, whose order is that of time, by the limits of `quantities`.

    The flags that they have are not looked at. Raises `InputError` where a quantity is unknown.
    """
    shared = {"location": _location(samples, water), "time": _time(samples.times)}
    notes = _notes(samples.times)
    samples = replace(samples, times=_spread(samples.times))
    air = _out_of_water(samples, quantities)
    flags: dict[str, Flags] = {}
    counts: dict[str, dict[str, tuple[int, int]]] = {}
    for key, column in samples.values.items():
        quantity = quantities.known(key)
        present = np.isfinite(column)
        flags[key] = np.where(present, Flag.GOOD, Flag.MISSING).astype(np.int64)
        if not present.any():
            continue
        common = shared | {"out of water": air} if quantity.on_sonde else shared
        tests = {name: one[present] for name, one in common.items()}
        tests |= _tests(column[present], samples.times[present], quantity)
        worst = np.max([np.where(_bad(one), one, Flag.GOOD) for one in tests.values()], axis=0)
        flags[key][present] = worst
        counts[key] = {
            name: (int(np.sum(one == Flag.SUSPECT)), int(np.sum(one == Flag.FAIL)))
            for name, one in tests.items()
        }
    return Quality(flags=flags, counts=counts, notes=notes)


def _spread(times: Array) -> Array:
    """Times that ascend strictly where they stand still: a logger that writes whole seconds took
    its readings within them.
    """
    if len(times) < 2 or np.any(np.diff(times) < 0):
        return times
    stamps, first, size = np.unique(times, return_index=True, return_counts=True)
    if len(stamps) == len(times):
        return times
    until = np.append(np.diff(stamps), np.median(np.diff(stamps)) if len(stamps) > 1 else 1.0)
    place = np.arange(len(times)) - np.repeat(first, size)
    return times + place * np.repeat(until / size, size)


def _bad(flags: Flags) -> NDArray[np.bool_]:
    return (flags == Flag.SUSPECT) | (flags == Flag.FAIL)


def _tests(values: Array, times: Array, quantity: Quantity) -> dict[str, Flags]:
    """The tests of one quantity on its values that are there; what has no limit is not tested."""
    qartod, limits = _qartod(), quantity.limits
    stamps = (1e9 * times).astype(np.int64).astype("datetime64[ns]")
    results: dict[str, Any] = {
        "gross range": qartod.gross_range_test(
            values, fail_span=limits.fail_span, suspect_span=_within(limits)
        )
    }
    if len(values) > 2 and np.median(np.diff(times)) > FASTEST_S:
        # A differential spike leaves the two neighbours of a spike alone.
        results["spike"] = qartod.spike_test(
            values,
            suspect_threshold=limits.spike_suspect,
            fail_threshold=limits.spike_fail,
            method="differential",
        )
        results["rate of change"] = qartod.rate_of_change_test(
            values, stamps, threshold=limits.rate_per_s
        )
        if math.isfinite(limits.flat_suspect_s + limits.flat_fail_s):
            # It counts in whole seconds, and a sonde may be faster: tell it of longer ones.
            slowed = (SLOWED * 1e9 * (times - times[0])).astype(np.int64).astype("datetime64[ns]")
            results["flat line"] = qartod.flat_line_test(
                values,
                slowed,
                suspect_threshold=int(SLOWED * limits.flat_suspect_s),
                fail_threshold=int(SLOWED * limits.flat_fail_s),
                tolerance=limits.flat_tolerance,
            )
    flags = {
        name: np.ma.filled(np.ma.asarray(one), Flag.NOT_EVALUATED).astype(np.int64)
        for name, one in results.items()
    }
    return flags | {"settling": _settling(values, times)} if quantity.on_sonde else flags


def _qartod() -> Any:
    """IOOS's tests, imported only when they are run; their types do not know arrays."""
    from ioos_qc import qartod

    return qartod


def _within(limits: Limits) -> tuple[float, float]:
    """The suspect span, not wider than the failing one."""
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
    return (f"{len(gaps)} gaps in time, the longest of {gaps.max():.0f} s",)


def _out_of_water(samples: Samples, quantities: Quantities) -> Flags:
    """Failed where a sensor that can tell reads what it does in the air, suspect just before and
    after.
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
    """Of the runs of low values those that begin or end with a jump."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    found = np.zeros(len(low), dtype=bool)
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        into = first > 0 and column[first - 1] > ABRUPT * column[first]
        out = end < len(column) and column[end] > ABRUPT * column[end - 1]
        found[first:end] = into or out or end - first == len(column)
    return found


def _settling(values: Array, times: Array) -> Flags:
    """Suspect while a sensor still approaches the water's value exponentially.

    Believed only where the approach explains the first minutes and is far larger than what
    the record shows in as long a time later: a real gradient is met again, a settling is not.
    """
    flags = np.full(len(values), Flag.GOOD)
    since = times - times[0]
    first = since <= SETTLING_S
    later = (since > SETTLING_S) & (since <= USUAL_S)
    if first.sum() < FEWEST_SAMPLES or later.sum() < FEWEST_SAMPLES:
        return flags
    approach = _approach(since[first], values[first])
    if approach is None:
        return flags
    amplitude, tau = approach
    if abs(amplitude) < CLEAR_FACTOR * _usual_change(since[later], values[later]):
        return flags
    flags[since <= tau * math.log(1 / SETTLED_SHARE)] = Flag.SUSPECT
    return flags


def _approach(since: Array, values: Array) -> tuple[float, float] | None:
    """Amplitude and time constant [s] of an exponential approach, if that is what it is."""
    spread = float(np.ptp(values))
    if spread == 0:
        return None
    scaled = (values - values[-1]) / spread

    def residuals(parameters: Array) -> Array:
        end, amplitude, tau = parameters
        return end + amplitude * np.exp(-since / tau) - scaled

    start = (0.0, float(scaled[0]), 40.0)
    bounds = ([-2.0, -5.0, 2.0], [2.0, 5.0, LONGEST_TAU_S])
    fit = least_squares(residuals, start, bounds=bounds)
    explained = 1 - float(np.sum(fit.fun**2)) / float(np.sum((scaled - scaled.mean()) ** 2))
    _, amplitude, tau = fit.x.tolist()
    if explained < EXPLAINED or tau > 0.98 * LONGEST_TAU_S:
        return None
    return amplitude * spread, tau


def _usual_change(since: Array, values: Array) -> float:
    """Median of how far the values range within a window of `SETTLING_WINDOW_S`."""
    window = ((since - since[0]) // SETTLING_WINDOW_S).astype(int)
    ranges = [np.ptp(values[window == k]) for k in np.unique(window)]
    return float(np.median(ranges))
