"""The picture of a movie: small maps at its times on one scale, and its level over time."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.dates import DateFormatter
from matplotlib.figure import Figure

from grebe.core.survey import Survey
from grebe.mapping.movie import Movie
from grebe.mapping.proof.validation import Z95
from grebe.report.canvas import BLUE, aspect, draw_shore, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from numpy.typing import NDArray

    from grebe.report.texts import Texts

# With more maps than these, each would be too small to be seen on a page.
MOST_MAPS, COLUMNS, LEVEL_INCHES, DAY_S = 8, 4, 2.2, 86_400.0


@styled
def movie_figure(survey: Survey, one: Movie, texts: Texts) -> Figure:
    """Some of the times, evenly spread, on one colour scale; below them the area's mean at all of
    them, with the uncertainty at the median place.
    """
    shown = shown_moments(len(one.times_s))
    rows = -(-len(shown) // COLUMNS)
    height = 2.5 * aspect(survey) + 0.35
    figure = Figure(figsize=(10.9, rows * height + LEVEL_INCHES))
    ratios = [*[height] * rows, LEVEL_INCHES]
    grid = figure.add_gridspec(rows + 1, COLUMNS, height_ratios=ratios)
    maps = [figure.add_subplot(grid[divmod(k, COLUMNS)]) for k in range(len(shown))]
    meshes = [_draw(axes, survey, one, i) for axes, i in zip(maps, shown, strict=True)]
    quantity = one.still.quantity
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    name = f"{quantity.label_in(texts.language)}{unit}"
    figure.colorbar(meshes[0], ax=maps, shrink=0.8, label=name)
    _draw_level(figure.add_subplot(grid[rows, :]), one, name, texts)
    return figure


def shown_moments(count: int) -> NDArray[np.int64]:
    """The indices of the times that are drawn: all, or every second, third or later one."""
    return np.arange(0, count, -(-count // MOST_MAPS))


def _draw(axes: Axes, survey: Survey, one: Movie, i: int) -> QuadMesh:
    low, high = np.nanpercentile(one.means, [1, 99])
    grid = one.still.grid
    mesh = axes.pcolormesh(
        grid.east, grid.north, one.means[i], cmap=one.still.quantity.colormap, vmin=low, vmax=high,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    draw_shore(axes, survey)
    axes.set_aspect("equal")
    axes.set_axis_off()
    moment = datetime.fromtimestamp(float(one.times_s[i]), UTC)
    axes.set_title(moment.strftime(_clock(one)), fontsize="medium")
    return mesh


def _draw_level(axes: Axes, one: Movie, name: str, texts: Texts) -> None:
    inside = one.still.grid.inside
    level = one.means[:, inside].mean(axis=1)
    error = Z95 * np.median(one.sds[:, inside], axis=1)
    times = np.array(one.times_s * 1e6, dtype="datetime64[us]")
    axes.fill_between(times, level - error, level + error, color=BLUE, alpha=0.2, lw=0)
    axes.plot(times, level, ".-", color=BLUE, lw=1.4)
    axes.set_title(texts["movie_level"])
    axes.set_ylabel(name)
    axes.set_xlabel("UTC")
    axes.xaxis.set_major_formatter(DateFormatter(_clock(one)))


def _clock(one: Movie) -> str:
    """The format of a time, with its day if the movie lasts a day or more."""
    return "%H:%M" if float(np.ptp(one.times_s)) < DAY_S else "%m-%d %H:%M"
