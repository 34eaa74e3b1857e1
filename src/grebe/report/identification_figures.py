"""A picture of an identification: measured and predicted motion, and parameters' intervals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from grebe.identification.result import FittedValue, Identification
from grebe.report.canvas import BLACK, BLUE, GREY, ORANGE, SKY, VERMILLION, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Of a longer drive, only the beginning is shown [s].
SHOWN_S = 240.0
# Half the width of an interval, in standard errors.
WIDTH = 2.0
AXES = (("surge [m/s]", 1.0), ("sway [m/s]", 1.0), ("yaw rate [deg/s]", 180.0 / math.pi))


@styled
def identification_figure(found: Identification) -> Figure:
    """Surge, sway and yaw rate, measured and predicted; below, each parameter's interval."""
    figure = Figure(figsize=(10.0, 9.6))
    *motions, numbers = figure.subplots(
        4, 1, height_ratios=(2, 2, 2, 0.6 + 0.17 * len(_boat(found)))
    )
    for channel, axes in enumerate(motions):
        _draw_motion(axes, found, channel)
    motions[0].set_title(f"{found.vessel.name}: {found.hold_out.horizon_s:g} s ahead")
    motions[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False)
    motions[2].set_xlabel("time [s]")
    _draw_numbers(numbers, _boat(found))
    return figure


def _boat(found: Identification) -> list[FittedValue]:
    return [one for one in found.parameters if not one.of_the_day]


def _draw_motion(axes: Axes, found: Identification, channel: int) -> None:
    label, scale = AXES[channel]
    course, check = found.course, found.hold_out
    shown = (course.times <= course.times[0] + SHOWN_S) & np.isfinite(course.measured[:, channel])
    if not shown.any():
        axes.set_ylabel(label)
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center")
        return
    times = course.times[shown]
    held, predicted = course.held_out[shown], scale * course.predicted[shown, channel]
    _shade(axes, times, held)
    axes.plot(
        times, scale * course.measured[shown, channel], ".", color=GREY, ms=2.5, label="measured"
    )
    # Leave a gap before each piece, because each starts from its own initial state.
    piece = np.cumsum(course.begins)[shown]
    for number in np.unique(piece):
        own = piece == number
        colour = VERMILLION if held[own].mean() > 0.5 else BLUE
        axes.plot(times[own], predicted[own], color=colour, lw=1.4)
    for colour, text in ((BLUE, "predicted"), (VERMILLION, "predicted, held out of the fit")):
        axes.plot([], [], color=colour, lw=1.4, label=text)
    axes.set_ylabel(label)
    axes.set_xlim(times[0], times[-1])
    before, after = scale * check.preset[channel], scale * check.fitted[channel]
    axes.text(
        0.995, 0.03, f"held out, rms: {after:.3f}; with the previous values: {before:.3f}",
        transform=axes.transAxes, ha="right", fontsize=8.5,
        bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 1.5},
    )  # fmt: skip


def _shade(axes: Axes, times: Array, held: NDArray[np.bool_]) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])))
    last = len(times) - 1
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(float(times[begin]), float(times[min(end, last)]), color=SKY, alpha=0.2, lw=0)


def _draw_numbers(axes: Axes, boat: list[FittedValue]) -> None:
    """Draw each parameter relative to its previous value, or its text alone if it had none."""
    places = np.arange(len(boat))[::-1]
    axes.axvline(1.0, color=BLACK, lw=0.8, ls="--")
    for place, one in zip(places, boat, strict=True):
        comparable = bool(one.before) and one.unit != "s"
        colour = BLUE if one.is_determined else ORANGE
        if comparable and one.before is not None:
            ratio, width = one.value / one.before, WIDTH * one.sd / one.before
            axes.errorbar(ratio, place, xerr=width, fmt="o", ms=4, color=colour, capsize=3)
        axes.text(
            1.01, place, one.text, transform=axes.get_yaxis_transform(), va="center", fontsize=8.5
        )
    axes.set_yticks(places, [one.name for one in boat], fontsize=8.5)
    axes.set_ylim(-0.7, len(boat) - 0.3)
    axes.set_xlabel(
        f"relative to the previous value (dashed), ± {WIDTH:g} standard errors; "
        "orange: not determined by this drive"
    )
    axes.grid(axis="x", lw=0.4, alpha=0.5)
