"""Pictures of maps: a quantity's mean and standard deviation, its uncertainty, and its change.

A mean has the colours of its quantity (mostly cividis) and a standard deviation has magma reversed.
The colour-blind can read both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.mapping.proof.validation import Z95
from grebe.mapping.scale import LINEAR
from grebe.report.canvas import (
    BLACK,
    BLUE,
    GREY,
    SKY,
    VERMILLION,
    Numbers,
    aspect,
    draw_shore,
    finish_map,
    styled,
    title_above,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from grebe.mapping.quantity_map import QuantityMap
    from grebe.mapping.series.difference import Difference
    from grebe.report.texts import Texts
    from grebe.report.thresholds import Threshold

# Probability of crossing a threshold below which it is not drawn.
LEAST_PROBABILITY = 0.01


@styled
def map_figure(
    survey: Survey, one: QuantityMap, samples: Samples, *, simulated: bool = False
) -> Figure:
    """Mean and standard deviation side by side, with the samples on the second, under a title that
    says when they were taken, and whether they are `simulated`.
    """
    figure = Figure(figsize=(10.9, 4.0 * aspect(survey) + 1.0))
    left, right = figure.subplots(1, 2)
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    _draw_field(figure, left, one, one.mean, one.quantity.colormap, f"{one.quantity.label}{unit}")
    _draw_field(figure, right, one, one.sd, "magma_r", f"Standard deviation{unit}")
    _draw_samples(right, one.quantity.key, samples)
    for axes in (left, right):
        draw_shore(axes, survey)
        finish_map(axes, survey)
    right.set_ylabel("")
    said = f"{survey.name}{_days(samples)}{', simulated' if simulated else ''}"
    figure.legend(loc="outside lower center", ncols=2, frameon=False, markerscale=3)
    title_above(figure, said)
    return figure


def _days(samples: Samples) -> str:
    """The days of the first and the last sample, as the end of a title."""
    if not len(samples):
        return ""
    ends = (int(samples.times.argmin()), int(samples.times.argmax()))
    days = dict.fromkeys(f"{samples.moment(one):%Y-%m-%d}" for one in ends)
    return f", {' to '.join(days)}"


def _draw_samples(axes: Axes, key: str, samples: Samples) -> None:
    """Draw the samples of a quantity; those left out by quality control have another marker."""
    measured = np.isfinite(samples.values[key])
    usable = samples.usable(key)
    for chosen, mark, size, colour, label in (
        (measured & usable, ".", 1.5, SKY, "samples"),
        (measured & ~usable, "x", 2.5, BLACK, "flagged: not used"),
    ):
        points = samples.positions[chosen]
        if len(points):
            axes.plot(
                points[:, 1], points[:, 0], mark, ms=size, color=colour, alpha=0.7, label=label
            )


@styled
def quantity_figure(
    survey: Survey, one: QuantityMap, thresholds: Sequence[Threshold], texts: Texts
) -> Figure:
    """All pictures of a quantity: mean and standard deviation, and below them the histogram and the
    variogram, with the probability of concern between them if there is any.
    """
    figure = Figure(figsize=(10.9, 4.4 * aspect(survey) + 4.3))
    grid = figure.add_gridspec(2, 6, height_ratios=(1.35 * aspect(survey) + 0.3, 1))
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    left, right = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
    title = texts("mean_title", label=one.quantity.label_in(texts.language))
    _draw_field(figure, left, one, one.mean, one.quantity.colormap, f"{title}{unit}")
    hatch(left, one, _uncertain(one))
    _draw_field(figure, right, one, one.sd, "magma_r", f"{texts['sd_title']}{unit}")
    points = one.positions
    right.plot(points[:, 1], points[:, 0], ".", ms=1.2, color=SKY, alpha=0.7)
    for axes in (left, right):
        draw_shore(axes, survey)
        finish_map(axes, survey, texts["east"], texts["north"])
    right.set_ylabel("")
    worst = _worst(one, thresholds)
    width = 3 if worst is None else 2
    histogram = figure.add_subplot(grid[1, :width])
    _draw_histogram(histogram, one, thresholds, texts)
    histogram.locator_params(axis="x", nbins=2 * width)
    if worst is not None:
        _draw_concern(figure, figure.add_subplot(grid[1, 2:4]), survey, one, worst, texts)
    _draw_variogram(figure.add_subplot(grid[1, -width:]), one, texts)
    return figure


@styled
def difference_figure(
    survey: Survey, one: QuantityMap, change: Difference, days: tuple[str, str]
) -> Figure:
    """The change, from blue (less) to red (more), or its size if all of it has the same sign;
    hatched where it may be zero.
    """
    figure = Figure(figsize=(7.2, 4.4 * aspect(survey) + 1.2))
    axes = figure.subplots()
    low, high = float(np.nanmin(change.mean)), float(np.nanmax(change.mean))
    most = max(-low, high) or 1.0
    colours, ends = ("RdBu_r", (-most, most)) if low <= 0 <= high else ("cividis", (low, high))
    grid = one.grid
    mesh = axes.pcolormesh(
        grid.east, grid.north, change.mean, cmap=colours, vmin=ends[0], vmax=ends[1],
        shading="nearest", rasterized=True,
    )  # fmt: skip
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    figure.colorbar(mesh, ax=axes, shrink=0.8, label=f"difference{unit}")
    hatch(axes, one, np.where(np.isfinite(change.mean), ~change.clear, False).astype(float))
    draw_shore(axes, survey)
    finish_map(axes, survey)
    title_above(figure, f"{one.quantity.label}: {days[1]} minus {days[0]}")
    return figure


def is_hatched(one: QuantityMap) -> bool:
    """Whether the picture of a map's mean is hatched anywhere."""
    return bool(_uncertain(one).max() > 0.5)


def _uncertain(one: QuantityMap) -> NDArray:
    """1 where the 95 % error is larger than the map's range, from 5 to 95 % of its area; else 0."""
    low, high = np.nanpercentile(one.mean, [5, 95])
    return np.where(Z95 * one.sd > high - low, 1.0, 0.0)


def _draw_histogram(
    axes: Axes, one: QuantityMap, thresholds: Sequence[Threshold], texts: Texts
) -> None:
    inside = one.mean[one.grid.inside]
    share = np.full(len(inside), 100 / len(inside))
    axes.hist(inside, bins=30, weights=share, color=BLUE)
    low, high = axes.get_xlim()
    for threshold in thresholds:
        if low <= threshold.value <= high:
            axes.axvline(threshold.value, color=VERMILLION, lw=1.4, ls="--")
    axes.set_xlim(low, high)
    axes.set_title(f"{texts['histogram_title']} [%]")
    axes.set_xlabel(one.quantity.unit or one.quantity.label_in(texts.language))


def _worst(one: QuantityMap, thresholds: Sequence[Threshold]) -> Threshold | None:
    """The threshold that is most likely to be crossed; None if none is, anywhere."""
    worst = max(thresholds, key=lambda each: np.nanmean(each.probability(one)), default=None)
    if worst is None or np.nanmax(worst.probability(one)) < LEAST_PROBABILITY:
        return None
    return worst


def _draw_concern(
    figure: Figure,
    axes: Axes,
    survey: Survey,
    one: QuantityMap,
    worst: Threshold,
    texts: Texts,
) -> None:
    """Draw the probability that a threshold is crossed."""
    mesh = axes.pcolormesh(
        one.grid.east, one.grid.north, worst.probability(one), cmap="magma_r", vmin=0, vmax=1,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    figure.colorbar(mesh, ax=axes, shrink=0.8, label=texts["probability"])
    draw_shore(axes, survey)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    unit = f" {one.quantity.unit}" if one.quantity.unit else ""
    value = f"{texts.number(f'{worst.value:g}')}{unit}"
    axes.set_title(texts("concern_title", sense=texts[worst.sense], value=value))


def _draw_variogram(axes: Axes, one: QuantityMap, texts: Texts) -> None:
    model, empirical = one.model, one.model.empirical
    if empirical is None:
        axes.set_axis_off()
        return
    axes.plot(
        empirical.distance_m, empirical.semivariance, "o", ms=4, color=BLUE,
        label=texts["pairs_label"],
    )  # fmt: skip
    h = np.linspace(empirical.distance_m[0] / 50, empirical.distance_m[-1], 200)
    if model.semivariance is not None:
        for factor, style in ((1.0, "-"), (model.ratio, ":")) if model.ratio < 1 else ((1.0, "-"),):
            label = texts["model_label" if factor == 1 else "across_label"]
            axes.plot(
                h, model.semivariance(h / factor), style, color=VERMILLION, lw=1.4, label=label
            )
    axes.set_ylim(bottom=0, top=1.35 * float(empirical.semivariance.max()) or None)
    axes.set_xlim(left=0)
    # Small semivariances, such as those of pH, with all their zeros would push the axes apart.
    numbers = Numbers(texts)
    numbers.set_powerlimits((-2, 5))
    numbers.set_useMathText(True)
    axes.yaxis.set_major_formatter(numbers)
    axes.set_title(texts["variogram_title"], loc="right")
    axes.set_xlabel(texts["distance"])
    # The square of a logarithm has no unit.
    unit = one.quantity.unit if one.scale == LINEAR else ""
    axes.set_ylabel(texts["semivariance"] + (f" [({unit})²]" if unit else ""))
    axes.legend(fontsize="small")


def hatch(axes: Axes, one: QuantityMap, where: NDArray) -> None:
    """Hatch the nodes where a field of zeros and ones is 1."""
    if where.max() < 0.5:
        return
    with mpl.rc_context({"hatch.color": GREY, "hatch.linewidth": 0.6}):
        axes.contourf(
            one.grid.east, one.grid.north, where, levels=[0.5, 1.5], colors="none",
            hatches=["////"],
        )  # fmt: skip


def _draw_field(
    figure: Figure, axes: Axes, one: QuantityMap, values: NDArray, colours: str, title: str
) -> None:
    mesh = axes.pcolormesh(
        one.grid.east, one.grid.north, values, cmap=colours, shading="nearest", rasterized=True
    )
    figure.colorbar(mesh, ax=axes, shrink=0.8)
    axes.set_title(title)
