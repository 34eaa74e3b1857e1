"""Plan for the map instead of for the cells: the pattern and the cells that make it most accurate.

A map's accuracy depends on where samples are taken and on the water's covariance, not on the values
of the samples. So plans of several patterns, each with the cell size that its budget allows, are
compared before anyone goes out, by the variance that they leave over all of the water.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import GrebeError, InputError, PlanError, UsageError
from grebe.core.plan_settings import PATTERNS, PlanSettings
from grebe.core.taut import path_through
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile
from grebe.mapping.covariance.models import PRACTICAL_RANGE, CovarianceModel
from grebe.mapping.covariance.posterior import fit_rough
from grebe.mapping.design import expected_variance
from grebe.mapping.grid import Grid, make_grid
from grebe.mapping.methods.base import Readings
from grebe.planning.planned import Planned
from grebe.planning.planner import plan
from grebe.planning.region import Region

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

CORES = (1.0, 0.6, 0.3)
CHOICES = len(PATTERNS) * len(CORES)
# Grid nodes at which plans are compared; the picture of the chosen one has the same.
NODES = 1_500
# The sonde's noise when it is not known, in standard deviations of the quantity.
NOISE_SHARE = 0.1
# The search for the cell size of an accuracy ends within this share of it, or after so many trials.
ALIKE, TRIALS = 0.03, 10


@dataclass(frozen=True, kw_only=True)
class Expected:
    """How accurate a plan's map is expected to be.

    `sd` (rows, columns) is the map's standard deviation over the quantity's own, NaN on land, and
    `share` its root mean square. `said` is the plan in a few words.
    """

    planned: Planned
    grid: Grid
    sd: Array
    share: float
    said: str

    @property
    def path(self) -> Array:
        """The shortest (taut) path (n, 2) along which samples are taken."""
        return path_through(self.planned.survey)


@dataclass(frozen=True, kw_only=True)
class AccuratePlan:
    """The plan that makes the map most accurate, and all that were tried, the best first."""

    best: Expected
    tried: tuple[Expected, ...]


def prior_of_range(practical_range_m: float) -> CovarianceModel:
    """Return a covariance of variance 1 with this practical range.

    It is exponential, which is rougher than most water. Raises `UsageError` for an impossible
    range.
    """
    if not 0 < practical_range_m < math.inf:
        raise UsageError(
            f"A range of {practical_range_m:g} m is impossible; give a positive number of metres.",
            settings=("range_m",),
        )
    return CovarianceModel(
        kind="exponential",
        sill=1.0,
        range_m=practical_range_m / PRACTICAL_RANGE["exponential"],
        nugget=NOISE_SHARE**2,
    )


def prior_of_survey(path: Path, quantity: str | None = None) -> CovarianceModel:
    """Return the covariance, scaled to variance 1, of what an earlier survey measured.

    It is that of one quantity, by default of the one with the shortest range.
    """
    with SurveyFile.open(path) as file:
        samples = file.samples()
    keys = [quantity] if quantity else list(samples.values)
    found: list[CovarianceModel] = []
    for key in keys:
        if key not in samples.values:
            raise InputError(f"{path} has no quantity {key!r}.")
        good = samples.usable(key)
        readings = Readings(positions=samples.positions[good], values=samples.values[key][good])
        try:
            model = fit_rough(readings.positions, readings.values, "matheron").model
        except ValueError:
            continue
        if model.sill > 0:
            found.append(replace(model, sill=1.0, nugget=model.nugget / model.sill))
    if not found:
        raise InputError(f"Nothing that {path} measured varies from place to place.")
    return min(found, key=lambda model: model.practical_range_m)


def expected(planned: Planned, prior: CovarianceModel, said: str = "") -> Expected:
    """Return how accurate a plan's map will be, for a quantity with a covariance of variance 1."""
    survey = planned.survey
    grid = make_grid(survey.water, math.sqrt(survey.water.area / NODES))
    pace_m = max(planned.outcome.length_m / max(planned.outcome.time_s, 1.0), 0.1)
    variance = expected_variance(path_through(survey), grid.nodes, prior, pace_m)
    share = math.sqrt(float(np.mean(variance)) / prior.sill)
    return Expected(
        planned=planned, grid=grid, sd=grid.spread(np.sqrt(variance / prior.sill)), share=share,
        said=said,
    )  # fmt: skip


def plan_for_accuracy(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    prior: CovarianceModel,
    *,
    sd_share: float | None = None,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
    on_done: Callable[[int, int], None] | None = None,
) -> AccuratePlan:
    """Plan for the most accurate map within the budget of the settings.

    With `sd_share`, plan for the shortest time in which the map's standard deviation is that share
    of the quantity's own. Raises `PlanError` if no pattern keeps the budget, or reaches the
    accuracy.
    """
    if sd_share is None and settings.cell_m is not None:
        raise UsageError(
            "A plan for accuracy needs minutes, watt-hours, or the accuracy itself.",
            settings=("minutes", "energy_wh", "sd_share"),
        )
    if sd_share is not None and not 0 < sd_share < 1:
        raise UsageError("The accuracy must be a share between 0 and 1.", settings=("sd_share",))

    def planned(wishes: PlanSettings) -> Planned:
        return plan(region, vessel, wishes, start_lonlat, no_go)

    choices = list(itertools.product(PATTERNS, CORES))
    found: list[Expected] = []
    refusals: list[GrebeError] = []
    for done, (pattern, core) in enumerate(choices, 1):
        wishes = replace(settings, pattern=pattern, core=core)
        said = f"{pattern}, core {core:g}"
        try:
            if sd_share is None:
                found.append(expected(planned(wishes), prior, said))
            else:
                found.append(_sure_enough(planned, wishes, prior, sd_share, said))
        except PlanError as error:
            refusals.append(error)
        if on_done is not None:
            on_done(done, len(choices))
    if not found:
        raise refusals[0]
    if sd_share is None:
        ranked = sorted(found, key=lambda one: one.share)
    else:
        ranked = sorted(found, key=lambda one: one.planned.outcome.time_s)
    return AccuratePlan(best=ranked[0], tried=tuple(ranked))


def _sure_enough(
    planned: Callable[[PlanSettings], Planned],
    settings: PlanSettings,
    prior: CovarianceModel,
    sd_share: float,
    said: str,
) -> Expected:
    """Return the plan with the largest cells whose map is accurate enough."""
    low, high, best = 0.0, math.inf, None
    cell_m = prior.practical_range_m * sd_share
    for _ in range(TRIALS):
        try:
            one = expected(
                planned(replace(settings, cell_m=cell_m, minutes=None, energy_wh=None)), prior, said
            )
        except PlanError:
            # The cells are larger than the water.
            high, cell_m = cell_m, math.sqrt(max(low, 0.1 * cell_m) * cell_m)
            continue
        if one.share <= sd_share:
            low, best = cell_m, one
            if one.share > (1 - ALIKE) * sd_share:
                break
        else:
            high = cell_m
        wider = cell_m * min(max(sd_share / one.share, 0.5), 2.0) ** 2
        cell_m = (
            wider
            if low < wider < high
            else math.sqrt(max(low, 0.5 * cell_m) * min(high, 2 * cell_m))
        )
    if best is None:
        raise PlanError(
            f"No plan makes the map as accurate as {sd_share:g} of "
            "the quantity's own standard deviation; ask for less, or give a longer range.",
            settings=("sd_share", "range_m"),
        )
    return best
