"""The picture of a campaign: the confidence limit, the missions' results, and the failures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from grebe.campaigns.certificate import clopper_pearson_lower, confidence_sequence
from grebe.campaigns.run import Outcome
from grebe.report.canvas import BLACK, BLUE, GREY, VERMILLION, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray


@styled
def campaign_figure(outcome: Outcome) -> Figure:
    """Draw the limit by mission, times against clearances, and failures over the weather."""
    figure = Figure(figsize=(13.0, 4.2))
    limit, went, weather = figure.subplots(1, 3)
    _draw_limit(limit, outcome)
    _draw_missions(went, outcome)
    _draw_weather(weather, outcome)
    return figure


def _draw_limit(axes: Axes, outcome: Outcome) -> None:
    outcomes = np.array([one.success for one in outcome.missions])
    count = np.arange(1, len(outcomes) + 1)
    claim = outcome.campaign.claim
    axes.plot(count, 100 * np.cumsum(outcomes) / count, color=GREY, label="succeeded so far")
    axes.plot(
        count,
        100 * _limits(outcome, outcomes),
        color=BLUE,
        lw=2,
        label=f"{100 * claim.confidence:g} % lower limit",
    )
    if claim.share is not None:
        axes.axhline(100 * claim.share, color=BLACK, ls="--", lw=1, label="claimed")
    axes.set_ylim(0, 103)
    axes.set_xlabel("missions")
    axes.set_ylabel("succeed [%]")
    axes.set_title("How sure")
    axes.legend(loc="lower right", frameon=False)


def _limits(outcome: Outcome, outcomes: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The limit after each mission; for a fixed number of missions, the final limit throughout."""
    claim = outcome.campaign.claim
    if outcome.is_sequential:
        return confidence_sequence(list(map(bool, outcomes)), claim.alpha)
    limits = np.full(len(outcomes), math.nan)
    limits[-1] = clopper_pearson_lower(int(outcomes.sum()), len(outcomes), claim.confidence)
    return np.where(np.isnan(limits), limits[-1], limits)


def _draw_missions(axes: Axes, outcome: Outcome) -> None:
    wanted = outcome.campaign.success
    axes.axvline(wanted.within_s / 60, color=BLACK, ls="--", lw=1)
    axes.axhline(wanted.clearance_m, color=BLACK, ls="--", lw=1)
    _scatter(
        axes,
        outcome,
        [one.duration_s / 60 for one in outcome.missions],
        [one.clearance_m for one in outcome.missions],
    )
    axes.set_xlabel("time of the mission [min]")
    axes.set_ylabel("least distance from the edge [m]")
    axes.set_title("How they went")


def _draw_weather(axes: Axes, outcome: Outcome) -> None:
    drawn = [one.drawn for one in outcome.missions]
    _scatter(
        axes,
        outcome,
        [float(one["current_mps"]) for one in drawn],
        [float(one["wind_n"]) for one in drawn],
    )
    axes.set_xlabel("current [m/s]")
    axes.set_ylabel("force of the wind [N]")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0, top=max(1.0, axes.get_ylim()[1]))
    axes.set_title("In which weather")


def _scatter(axes: Axes, outcome: Outcome, x: list[float], y: list[float]) -> None:
    """Draw successes as dots and failures as crosses, to distinguish them without colours too."""
    good = np.array([one.success for one in outcome.missions])
    across, up = np.array(x), np.array(y)
    axes.plot(
        across[good], up[good], "o", ms=3.5, mec="none", mfc=BLUE, alpha=0.6, label="succeeded"
    )
    if not good.all():
        axes.plot(across[~good], up[~good], "x", ms=7, mew=1.8, color=VERMILLION, label="failed")
    legend_above(axes)
