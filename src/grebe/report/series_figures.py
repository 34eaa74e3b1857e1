"""A picture of a series of surveys: the trend at each place, and the mean over the area."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from grebe.core.survey import Survey
from grebe.report.canvas import (
    BLACK,
    BLUE,
    VERMILLION,
    aspect,
    draw_shore,
    finish_map,
    styled,
    title_above,
)
from grebe.report.map_figures import hatch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from grebe.mapping.series.surveys import QuantitySeries


@styled
def trend_figure(survey: Survey, one: QuantitySeries) -> Figure:
    """Left: the trend, from blue (falling) to red (rising), hatched where it is not clear. Right:
    the mean over the area in each survey, with the line fitted to them.
    """
    figure = Figure(figsize=(10.9, 4.0 * aspect(survey) + 1.0))
    left, right = figure.subplots(1, 2)
    quantity, grid, trend = one.first.quantity, one.first.grid, one.trend
    slope = grid.spread(trend.slope)
    most = float(np.nanmax(np.abs(slope))) or 1.0
    mesh = left.pcolormesh(
        grid.east, grid.north, slope, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    figure.colorbar(mesh, ax=left, shrink=0.8)
    hatch(left, one.first, np.nan_to_num(grid.spread((~trend.clear).astype(float))))
    draw_shore(left, survey)
    unit = f" {quantity.unit}" if quantity.unit else ""
    left.set_title(f"{quantity.label}: trend [{unit.strip() or '1'} / year]")
    finish_map(left, survey)
    _draw_mean(right, one)
    right.set_title(f"Mean over the area{f' [{quantity.unit}]' if quantity.unit else ''}")
    days = [datetime.fromtimestamp(s, UTC) for s in one.times_s[[0, -1]]]
    clear = float(np.mean(trend.clear))
    said = "hatched: no clear trend" if clear < 1 else "a trend everywhere"
    title_above(
        figure,
        f"{survey.name}, {len(one.times_s)} surveys, {days[0]:%Y-%m-%d} to {days[1]:%Y-%m-%d} "
        f"({said})",
    )
    return figure


def _draw_mean(axes: Axes, one: QuantitySeries) -> None:
    times = np.array(one.times_s * 1e3, dtype="datetime64[ms]")
    axes.plot(times, one.trend.mean_values, "o", ms=5, color=BLUE)
    axes.plot(times, one.trend.fitted_mean, "-", lw=1.4, color=VERMILLION)
    mean = one.trend.of_mean
    axes.text(
        0.02, 0.02, f"{mean.slope:+.3g} ± {mean.half_width:.2g} a year (95 %)",
        transform=axes.transAxes, color=BLACK,
    )  # fmt: skip
    axes.margins(y=0.25)
    axes.tick_params(axis="x", labelrotation=30)
