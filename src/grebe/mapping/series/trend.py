"""How a water changed over the years, place by place, from a series of surveys.

A survey's map differs from the water by its own errors, and everywhere alike by the weather of the
day and the calibration of the sensor. With three to ten surveys the common error dominates, and it
is the same at all places: a thousand places that rise together on one warm day are one observation.
So a trend's variance has two parts. That of the survey as a whole comes from the scatter of the
area's mean about its line, with the degrees of freedom that the line leaves. That of the place
comes from the scatter about the area's mean, and is never less than the maps' own errors.
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
# Surveys no farther apart than this are of the same day [s].
ONE_DAY_S = 0.5 * 86_400
# A trend needs surveys on one day more than its line has parameters.
FEWEST_SURVEYS = 3
# To separate a season from a trend takes this many surveys, over this many years.
FEWEST_FOR_SEASON, LEAST_YEARS_FOR_SEASON = 6, 2.0
# Beyond this condition number, a yearly wave is fitted to next to nothing.
WORST_CONDITION = 100.0
# Of the places called changed, this share may be unchanged (false discovery rate).
DISCOVERY_RATE = 0.05


@dataclass(frozen=True, kw_only=True)
class MeanTrend:
    """The trend of the mean over the area [unit / year], its standard error and degrees of freedom,
    and the two-sided probability of a trend as large by chance.
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
    """The trend `slope` (m,) of each of m places [unit / year], its standard error `sd` (m,), and
    `adjusted_p` (m,): among the places at or below a value, no more than that share is called
    changed in error (Benjamini and Hochberg 1995). `of_mean` is the trend of the mean over the
    area, `mean_values` (n,) are that mean in each survey, and `fitted_mean` (n,) the line fitted to
    them.
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
    independent, at least 1. With `seasonal`, a yearly wave, the same in each year, is added to the
    line.

    Raises `InputError` if there are too few surveys, or all are of one time.
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
    # Each place about the area's mean, pooled: one place alone has too few surveys.
    apart = leftover @ (mean - over_area[:, None])
    scatter = float(np.mean(np.sum(apart**2, axis=0))) / freedom
    local = np.maximum(row**2 @ sd**2, squares * scatter)
    slope = row @ mean
    variance = whole + local
    # Satterthwaite's degrees of freedom for a sum of variances.
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
    """Split ascending times (n,) [unix s] into days: within one, successive times are no more than
    `ONE_DAY_S` apart.
    """
    return np.split(times_s, np.flatnonzero(np.diff(times_s) > ONE_DAY_S) + 1)


def check_times(times_s: Array, *, seasonal: bool) -> None:
    """Raise `InputError` if surveys at these times (n,) [unix s] show no trend, or no season."""
    _design(np.asarray(times_s, dtype=float), seasonal=seasonal)


def adjusted(p: Array) -> Array:
    """Probabilities (m,) adjusted for their number: among those at or below a value, no more than
    that share is false (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57: 289).
    """
    order = np.argsort(p)[::-1]
    ranks = np.arange(len(p), 0, -1)
    found = np.empty_like(p)
    found[order] = np.minimum(np.minimum.accumulate(p[order] * len(p) / ranks), 1.0)
    return found


def adjusted_for_family(p: Array) -> Array:
    """Probabilities (m,) adjusted for their number: the probability of any error among those at or
    below a value is no more than that value (Holm 1979, Scand. J. Stat. 6: 65).
    """
    order = np.argsort(p)
    steps = p[order] * np.arange(len(p), 0, -1)
    found = np.empty_like(p)
    found[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return found


def _design(times_s: Array, *, seasonal: bool) -> Array:
    """One row for each survey: 1, the time in years, and for a season the yearly wave."""
    count, years = len(times_s), (times_s - times_s.mean()) / YEAR_S
    span = float(np.ptp(years))
    if count < FEWEST_SURVEYS:
        raise InputError(f"A trend needs surveys of {FEWEST_SURVEYS} days, not {count}.")
    if span * YEAR_S < 1.0:
        raise InputError("The surveys are all of the same time, so no trend can be estimated.")
    columns = [np.ones(count), years]
    if seasonal:
        if count < FEWEST_FOR_SEASON or span < LEAST_YEARS_FOR_SEASON:
            raise InputError(
                f"To separate a season from a trend takes {FEWEST_FOR_SEASON} surveys over "
                f"{LEAST_YEARS_FOR_SEASON:g} years; there are {count} over {span:.1f}.",
                settings=("seasonal",),
            )
        # The phase relative to the calendar year does not matter: both waves are fitted.
        phase = 2 * np.pi * times_s / YEAR_S
        columns += [np.cos(phase), np.sin(phase)]
    design = np.column_stack(columns)
    # Days that differ only by the quarter days of leap years are the same time of the year.
    if np.linalg.cond(design / np.linalg.norm(design, axis=0)) > WORST_CONDITION:
        raise InputError(
            "The surveys are all of the same time of year, so no season can be estimated.",
            settings=("seasonal",),
        )
    return design


def _of_mean(slope: float, sd: float, freedom: int) -> MeanTrend:
    p = _two_sided(np.array([slope]), np.array([sd]), np.array([float(freedom)]))
    return MeanTrend(slope=slope, sd=sd, freedom=freedom, p=float(p[0]))


def _two_sided(slope: Array, sd: Array, freedom: Array) -> Array:
    """Probability (m,) of a slope as large by chance, by Student's distribution."""
    from scipy.special import stdtr

    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(sd > 0, np.abs(slope) / sd, np.where(slope == 0, 0.0, np.inf))
    return np.asarray(2 * stdtr(freedom, -t), dtype=np.float64)
