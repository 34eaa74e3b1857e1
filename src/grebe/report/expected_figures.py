"""A picture of how accurate a map will be, before anything is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from grebe.core.survey import Survey
from grebe.report.canvas import SKY, draw_no_go, draw_shore, figure_size, finish_map, styled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.mapping.grid import Grid


@styled
def expected_figure(
    survey: Survey, grid: Grid, sd: NDArray[np.floating], path: NDArray[np.floating]
) -> Figure:
    """The expected standard deviation (rows, columns) as a share of the quantity's own, and the
    path `path` (n, 2) along which samples are taken.
    """
    figure = Figure(figsize=figure_size(survey))
    axes = figure.subplots()
    half = grid.step_m / 2
    shown = axes.imshow(
        sd,
        origin="lower",
        extent=(
            float(grid.east[0]) - half, float(grid.east[-1]) + half,
            float(grid.north[0]) - half, float(grid.north[-1]) + half,
        ),
        cmap="magma_r",
        vmin=0.0,
        vmax=1.0,
    )  # fmt: skip
    axes.plot(path[:, 1], path[:, 0], color=SKY, lw=0.8, label="path")
    draw_shore(axes, survey)
    draw_no_go(axes, survey)
    figure.colorbar(
        shown, ax=axes, label="standard deviation of the map / of the quantity", shrink=0.8
    )
    share = float(np.sqrt(np.nanmean(sd**2)))
    axes.set_title(f"{survey.name}: expected {share:.0%} of the quantity's standard deviation")
    finish_map(axes, survey)
    return figure
