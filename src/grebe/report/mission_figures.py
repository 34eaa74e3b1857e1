"""Pictures of a plan and of a mission: cells in order, the track, speed and thrusts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from grebe.core.samples import Samples
from grebe.core.survey import Survey, Target
from grebe.io.store import TrackTable
from grebe.report.canvas import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    VERMILLION,
    draw_no_go,
    draw_start,
    draw_water,
    figure_size,
    finish_map,
    legend_above,
    legend_below,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from grebe.report.texts import Texts

# With more cells than these, edges and arrows would hide everything else.
MANY_CELLS = 3_000
ARROWS = 24


@styled
def plan_figure(survey: Survey) -> Figure:
    """The water, the cells coloured by their order, the path through them, and the start."""
    figure = Figure(figsize=figure_size(survey))
    axes = figure.subplots()
    draw_water(axes, survey)
    visited = [t for t in survey.targets if t.kind == "cell"]
    many = len(visited) > MANY_CELLS
    edges = "none" if many else "white"
    cells = PolyCollection(
        cast("Any", _corners(visited)), cmap="cividis", edgecolors=edges, linewidths=0.5, alpha=0.85
    )
    cells.set_array([t.seq for t in visited])
    axes.add_collection(cells)
    draw_no_go(axes, survey)
    centres = np.array([t.set.centre for t in survey.targets])
    axes.plot(
        centres[:, 1], centres[:, 0], color=VERMILLION, lw=0.4 if many else 1.0,
        label="order of the cells",
    )  # fmt: skip
    _draw_transits(axes, survey, centres)
    if not many:
        _draw_direction(axes, centres)
    if survey.start is not None:
        lead = np.array([[survey.start.north_m, survey.start.east_m], centres[0]])
        axes.plot(lead[:, 1], lead[:, 0], color=VERMILLION, lw=1.0, ls=":", label="lead-in")
    draw_start(axes, survey)
    figure.colorbar(cells, ax=axes, label="order of visit", shrink=0.8)
    axes.set_title(f"{survey.name}: {len(survey.targets)} target sets")
    finish_map(axes, survey)
    legend_below(axes)
    return figure


@styled
def track_figure(survey: Survey, track: TrackTable, samples: Samples, texts: Texts) -> Figure:
    """The boat's track over the cells, and where the samples were taken."""
    figure = Figure(figsize=figure_size(survey))
    axes = figure.subplots()
    draw_water(axes, survey)
    corners = [np.asarray(t.set.vertices)[:, ::-1] for t in survey.targets]
    axes.add_collection(PolyCollection(corners, facecolors="none", edgecolors=GREY, linewidths=0.5))
    for k, one in enumerate(track.each_boat()):
        label = texts["track_label"] if k == 0 else None
        axes.plot(one.states[:, 1], one.states[:, 0], color=BLUE, lw=1.1, label=label)
    axes.plot(
        samples.positions[:, 1],
        samples.positions[:, 0],
        ".",
        ms=3.5,
        color=VERMILLION,
        label=texts["samples_label"],
    )
    draw_start(axes, survey, texts["start"])
    axes.set_title(f"{survey.name}: {texts['track_title'].lower()}")
    finish_map(axes, survey, texts["east"], texts["north"])
    legend_below(axes)
    return figure


@styled
def series_figure(survey: Survey, track: TrackTable, texts: Texts) -> Figure:
    """Speed and thrusts over time, with the speed window shaded (the paper's Figs. 8 and 9)."""
    figure = Figure(figsize=(9.0, 4.6))
    speed, thrust = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    # Transits around land may be sailed at any speed.
    cells = [t.set for t in survey.targets if t.kind == "cell"] or list(survey.sets)
    low = min(one.speed_min_mps for one in cells)
    high = max(one.speed_max_mps for one in cells)
    speed.axhspan(low, high, color=SKY, alpha=0.3, lw=0,
                  label=texts("window_label", low=texts.number(f"{low:g}"),
                              high=texts.number(f"{high:g}")))  # fmt: skip
    boats = track.each_boat()
    for k, one in enumerate(boats):
        label = texts["surge"] if k == 0 else None
        speed.plot(one.seconds, one.states[:, 3], color=BLUE, lw=0.9, label=label)
    speed.set_ylabel(texts["surge_axis"])
    speed.set_title(texts["speed_title"])
    legend_above(speed, fontsize=8.5)
    for column, name, colour in ((0, "port", ORANGE), (1, "starboard", GREEN)):
        for k, one in enumerate(boats):
            thrust.step(
                one.seconds,
                one.thrusts[:, column],
                where="post",
                lw=0.8,
                color=colour,
                label=texts[name] if k == 0 else None,
            )
    if survey.vessel is not None:
        for limit in (survey.vessel.thrust_min_n, survey.vessel.thrust_max_n):
            thrust.axhline(limit, color=GREY, lw=0.8, ls="--")
    thrust.set_ylabel(texts["thrust_axis"])
    thrust.set_xlabel(texts["time_axis"])
    legend_above(thrust, fontsize=8.5)
    return figure


def _corners(targets: Sequence[Target]) -> NDArray[np.float64]:
    """The corners of targets (n, m, 2), east first. Targets with fewer corners repeat their last
    one, because a single array is converted to paths at once.
    """
    rings = [target.set.vertices for target in targets]
    most = max(map(len, rings), default=3)
    padded = [ring + ring[-1:] * (most - len(ring)) for ring in rings]
    return np.array(padded, dtype=float).reshape(-1, most, 2)[:, :, ::-1]


def _draw_transits(axes: Axes, survey: Survey, centres: NDArray[np.float64]) -> None:
    """Draw the path to and from each transit, where the boat goes around land."""
    is_transit = np.array([t.kind == "transit" for t in survey.targets])
    if not is_transit.any():
        return
    near = is_transit | np.roll(is_transit, 1) | np.roll(is_transit, -1)
    gaps = np.where(near[:, None], centres, np.nan)
    axes.plot(gaps[:, 1], gaps[:, 0], color=ORANGE, lw=1.6, label="transits")
    places = centres[is_transit]
    axes.plot(places[:, 1], places[:, 0], ".", color=ORANGE, ms=4)


def _draw_direction(axes: Axes, centres: NDArray[np.float64]) -> None:
    """Draw a few arrows along the path."""
    step = max(1, len(centres) // ARROWS)
    tails = centres[:-1:step]
    legs = (centres[1:] - centres[:-1])[::step]
    axes.quiver(
        tails[:, 1], tails[:, 0], legs[:, 1], legs[:, 0], color=VERMILLION, angles="xy",
        scale_units="xy", scale=1, width=0.004, headwidth=6, headlength=7, headaxislength=6,
    )  # fmt: skip
