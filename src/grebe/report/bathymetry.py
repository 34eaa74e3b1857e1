"""The lake's volume and hypsographic curve, from the map of its depth: figures, picture, CSV."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.figure import Figure

from grebe.core.survey import Survey
from grebe.io.atomic_write import write_rows_whole
from grebe.mapping.bathymetry import WATER_DEPTH, Bathymetry, bathymetry
from grebe.mapping.proof.validation import Z95
from grebe.mapping.quantity_map import QuantityMap
from grebe.report.canvas import BLUE, VERMILLION, styled
from grebe.report.texts import Texts, texts_of

# Draws of the map, and the most nodes at which they are made; they represent the whole lake.
DRAWS, MOST_NODES = 100, 4_000
COLUMNS = ("depth_m", "area_m2", "area_sd_m2", "volume_below_m3", "volume_below_sd_m3")


def bathymetry_of(one: QuantityMap, survey: Survey) -> Bathymetry | None:
    """The lake's figures from the map of its depth; None for a map of another quantity."""
    if one.quantity.key != WATER_DEPTH:
        return None
    inside = one.grid.inside
    every = math.ceil(inside.sum() / MOST_NODES)
    return bathymetry(one.mean[inside], survey.water.area, one.draws_at_nodes(DRAWS, every))


@styled
def hypsographic_figure(lake: Bathymetry, texts: Texts | None = None) -> Figure:
    """Area and volume below each depth, with depth downwards and 95 % bands."""
    t, curve = texts or texts_of("en"), lake.curve
    figure = Figure(figsize=(8.4, 4.0))
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, values, sd, colour, title in (
        (left, curve.area_m2, curve.area_sd_m2, BLUE, f"{t['hypsographic_area']} [m²]"),
        (right, curve.volume_m3, curve.volume_sd_m3, VERMILLION,
         f"{t['hypsographic_volume']} [m³]"),
    ):  # fmt: skip
        low, high = (values - Z95 * sd).clip(min=0), values + Z95 * sd
        axes.fill_betweenx(curve.depth_m, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(values, curve.depth_m, color=colour, lw=1.6)
        axes.set_title(title)
        axes.set_xlim(left=0)
        axes.locator_params(axis="x", nbins=5)
    left.invert_yaxis()
    left.set_ylabel(t["depth_axis"])
    return figure


def write_hypsography(path: Path, lake: Bathymetry) -> None:
    """Write the hypsographic curve as CSV, one depth per line."""
    curve = lake.curve
    rows = zip(
        curve.depth_m, curve.area_m2, curve.area_sd_m2, curve.volume_m3, curve.volume_sd_m3,
        strict=True,
    )  # fmt: skip
    write_rows_whole(path, COLUMNS, ([f"{value:.6g}" for value in row] for row in rows))
