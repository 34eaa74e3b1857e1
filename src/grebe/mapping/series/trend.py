"""What a series of surveys of one water tells of its change over the years, place by place.

A survey's map misses the water by its own errors; and all of the water, by what the day was like
and how the sensor was calibrated. With three to ten surveys the second is what counts, and it is
the same at all places: a thousand places that rise together on one warm day are one observation.
So a trend's variance has two parts: of the survey as a whole, known from the scatter of the mean
over the area about its line, with as many degrees of freedom as surveys are left by the line; and
of the place, from the scatter about the area's mean, never less than the maps' own errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

YEAR_S = 365.25 * 86_400
# Surveys no further apart than this are of one day [s].
ONE_DAY_S = 0.5 * 86_400
# A trend needs surveys of a day more than its line has parameters.
FEWEST_SURVEYS = 3
# A season is told from a trend by so many surveys at least, over so many years.
FEWEST_FOR_SEASON, LEAST_YEARS_FOR_SEASON = 6, 2.0
# Beyond this condition number a wave of a year is fitted to next to nothing.
WORST_CONDITION = 100.0
# Of the places that are called changed, so many may not have (false discovery rate).
DISCOVERY_RATE = 0.05


@dataclass(frozen=True, kw_only=True)
class MeanTrend:
    """The trend of the mean over the area [unit / year], its standard error, the degrees of freedom
    of that, and the two-sided probability of one as large without a trend.
    """

    slope: float
    sd: float
    freedom: int
    p: float

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval."""
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, 0.975)) * self.sd


@dataclass(frozen=True, kw_only=True)
class Trend:
    """The trend of each of m places [unit / year] `slope` (m,), its standard error `sd` (m,), and
    `adjusted_p` (m,): of the places with no more than this, as large a share is called changed in
    error (Benjamini and Hochberg 1995). `of_mean` is that of the mean over the area,
    `mean_values` (n,) what it was made of, and `fitted_mean` (n,) what is left of them.
    """

    slope: Array
    sd: Array
    adjusted_p: Array
    of_mean: MeanTrend
    mean_values: Array
    fitted_mean: Array

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Where the water has changed, at a false discovery rate of 5 %."""
        return self.adjusted_p <= DISCOVERY_RATE


def fit_trend(
    times_s: Array, mean: Array, sd: Array, *, seasonal: bool = False, patches: float = 1.0
) -> Trend:
    """Fit a line over time to each place of n maps.

    `times_s` (n,) [unix s]; `mean` and `sd` (n, m) of the maps; `patches`: how many places are
    independent, at least 1. With `seasonal` the line has a wave of a year beside it, the same in
    each year.

    Raises `InputError` where there are too few surveys, or all of one time.
    """
    design = _design(np.asarray(times_s, dtype=float), seasonal=seasonal)
    count, parameters = design.shape
    freedom = count - parameters
    solve = np.linalg.pinv(design)
    row, leftover = solve[1], np.eye(count) - design @ solve
    over_area = mean.mean(axis=1)
    spread = float(np.sum((leftover @ over_area) ** 2)) / freedom
    squares = float(row @ row)
    whole = squares * spread
    # Each place about the area's mean, pooled: a place alone has too few surveys to tell by.
    apart = leftover @ (mean - over_area[:, None])
    scatter = float(np.mean(np.sum(apart**2, axis=0))) / freedom
    local = np.maximum(row**2 @ sd**2, squares * scatter)
    slope = row @ mean
    variance = whole + local
    # Satterthwaite's degrees of freedom of a sum of variances.
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = whole**2 / freedom + local**2 / (freedom * max(patches, 1.0))
        degrees = np.where(variance > 0, variance**2 / parts, freedom)
    return Trend(
        slope=slope,
        sd=np.sqrt(variance),
        adjusted_p=adjusted(_two_sided(slope, np.sqrt(variance), degrees)),
        of_mean=_of_mean(float(row @ over_area), math.sqrt(whole), freedom),
        mean_values=over_area,
        fitted_mean=design @ solve @ over_area,
    )


def days_of(times_s: Array) -> list[Array]:
    """Times (n,) [unix s], which ascend, in parts of one day each: no more than `ONE_DAY_S` from
    one to the next.
    """
    return np.split(times_s, np.flatnonzero(np.diff(times_s) > ONE_DAY_S) + 1)


def check_times(times_s: Array, *, seasonal: bool) -> None:
    """Raise `InputError` where surveys at these times (n,) [unix s] tell no trend, or no season."""
    _design(np.asarray(times_s, dtype=float), seasonal=seasonal)


def adjusted(p: Array) -> Array:
    """Probabilities (m,) adjusted for their number, so that a share of no more than that of those
    at or below each is false (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57: 289).
    """
    order = np.argsort(p)[::-1]
    ranks = np.arange(len(p), 0, -1)
    found = np.empty_like(p)
    found[order] = np.minimum(np.minimum.accumulate(p[order] * len(p) / ranks), 1.0)
    return found


def adjusted_for_family(p: Array) -> Array:
    """Probabilities (m,) adjusted so that any error among those at or below each is no likelier
    than that (Holm 1979, Scand. J. Stat. 6: 65).
    """
    order = np.argsort(p)
    steps = p[order] * np.arange(len(p), 0, -1)
    found = np.empty_like(p)
    found[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return found


def _design(times_s: Array, *, seasonal: bool) -> Array:
    """One row a survey: 1, the time in years, and with a season the wave of a year."""
    count, years = len(times_s), (times_s - times_s.mean()) / YEAR_S
    span = float(np.ptp(years))
    if count < FEWEST_SURVEYS:
        raise InputError(
            f"A trend needs surveys of {FEWEST_SURVEYS} days; there are those of {count}."
        )
    if span * YEAR_S < 1.0:
        raise InputError("The surveys are all of one time: there is no trend to see.")
    columns = [np.ones(count), years]
    if seasonal:
        if count < FEWEST_FOR_SEASON or span < LEAST_YEARS_FOR_SEASON:
            raise InputError(
                f"To tell a season from a trend takes {FEWEST_FOR_SEASON} surveys over "
                f"{LEAST_YEARS_FOR_SEASON:g} years; there are {count} over {span:.1f}.",
                settings=("seasonal",),
            )
        # The phase of the calendar year does not matter: both waves are fitted.
        phase = 2 * np.pi * times_s / YEAR_S
        columns += [np.cos(phase), np.sin(phase)]
    design = np.column_stack(columns)
    # Days that differ by the leap years' quarters alone are the same time of the year.
    if np.linalg.cond(design / np.linalg.norm(design, axis=0)) > WORST_CONDITION:
        raise InputError(
            "The surveys are all of the same time of the year: there is no season to tell.",
            settings=("seasonal",),
        )
    return design


def _of_mean(slope: float, sd: float, freedom: int) -> MeanTrend:
    p = _two_sided(np.array([slope]), np.array([sd]), np.array([float(freedom)]))
    return MeanTrend(slope=slope, sd=sd, freedom=freedom, p=float(p[0]))


def _two_sided(slope: Array, sd: Array, freedom: Array) -> Array:
    """Probability (m,) of a slope as large without a trend, by Student's distribution."""
    from scipy.special import stdtr

    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(sd > 0, np.abs(slope) / sd, np.where(slope == 0, 0.0, np.inf))
    return np.asarray(2 * stdtr(freedom, -t), dtype=np.float64)
