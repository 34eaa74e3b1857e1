"""Pictures: of a plan, of a mission, of a map. East to the right, north up.

Colours: cividis for a mean, magma reversed for a standard deviation, Okabe-Ito for lines;
all can be read by the colour-blind.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from grebe.errors import InputError
from grebe.mapping.difference import Difference
from grebe.mapping.maps import QuantityMap
from grebe.report.data import ReportData
from grebe.report.texts import Texts
from grebe.report.thresholds import Threshold
from grebe.store import SampleTable, TrackTable
from grebe.survey import Survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
)
GREY = "#8c8c8c"
STYLE: dict[str, Any] = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "grebe",
}
DPI = 130
# Beyond so many cells their edges and arrows would be all there is to see.
MANY_CELLS = 3_000
ARROWS = 24


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw within Grebe's style and leave matplotlib's settings as they were."""

    def wrapped(*args: Any, **options: Any) -> Figure:
        with mpl.rc_context(cast(Any, STYLE)):
            return draw(*args, **options)

    wrapped.__doc__ = draw.__doc__
    return wrapped


@styled
def plan_figure(survey: Survey) -> Figure:
    """The water, the cells coloured by their order, the way through them and the start."""
    figure = Figure(figsize=_size(survey))
    axes = figure.subplots()
    _draw_water(axes, survey)
    visited = [t for t in survey.targets if t.kind == "cell"]
    corners = [np.asarray(t.set.vertices)[:, ::-1] for t in visited]
    many = len(corners) > MANY_CELLS
    edges = "none" if many else "white"
    cells = PolyCollection(corners, cmap="cividis", edgecolors=edges, linewidths=0.5, alpha=0.85)
    cells.set_array([t.seq for t in visited])
    axes.add_collection(cells)
    _draw_no_go(axes, survey)
    centres = np.array([t.set.centre for t in survey.targets])
    axes.plot(
        centres[:, 1], centres[:, 0], color=VERMILLION, lw=0.4 if many else 1.0,
        label="order of the cells",
    )  # fmt: skip
    _draw_transits(axes, survey)
    if not many:
        _draw_direction(axes, centres)
    if survey.start is not None:
        lead = np.array([[survey.start.north_m, survey.start.east_m], centres[0]])
        axes.plot(lead[:, 1], lead[:, 0], color=VERMILLION, lw=1.0, ls=":", label="lead-in")
    _draw_start(axes, survey)
    figure.colorbar(cells, ax=axes, label="order of visit", shrink=0.8)
    axes.set_title(f"{survey.name}: {len(survey.targets)} target sets")
    _finish_map(axes, survey)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    return figure


@styled
def track_figure(survey: Survey, track: TrackTable, samples: SampleTable, texts: Texts) -> Figure:
    """The boat's track over the cells, and where samples were taken."""
    figure = Figure(figsize=_size(survey))
    axes = figure.subplots()
    _draw_water(axes, survey)
    corners = [np.asarray(t.set.vertices)[:, ::-1] for t in survey.targets]
    axes.add_collection(PolyCollection(corners, facecolors="none", edgecolors=GREY, linewidths=0.5))
    if len(track):
        axes.plot(
            track.states[:, 1], track.states[:, 0], color=BLUE, lw=1.1, label=texts["track_label"]
        )
    axes.plot(
        samples.positions[:, 1],
        samples.positions[:, 0],
        ".",
        ms=3.5,
        color=VERMILLION,
        label=texts["samples_label"],
    )
    _draw_start(axes, survey, texts["start"])
    axes.set_title(f"{survey.name}: {texts['track_title'].lower()}")
    _finish_map(axes, survey, texts["east"], texts["north"])
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    return figure


@styled
def series_figure(survey: Survey, track: TrackTable, texts: Texts) -> Figure:
    """Speed and thrusts over time, the speed window shaded (the paper's Figs. 8 and 9)."""
    figure = Figure(figsize=(9.0, 4.6))
    speed, thrust = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    low = min(t.set.speed_min_mps for t in survey.targets)
    high = max(t.set.speed_max_mps for t in survey.targets)
    speed.axhspan(low, high, color=SKY, alpha=0.3, lw=0,
                  label=texts("window_label", low=f"{low:g}", high=f"{high:g}"))  # fmt: skip
    speed.plot(track.seconds, track.states[:, 3], color=BLUE, lw=0.9, label=texts["surge"])
    speed.set_ylabel(texts["surge_axis"])
    speed.set_title(texts["speed_title"])
    speed.legend(loc="upper right", ncols=2, fontsize=8.5, framealpha=0.9)
    for column, name, colour in ((0, "port", ORANGE), (1, "starboard", GREEN)):
        thrust.step(
            track.seconds,
            track.thrusts[:, column],
            where="post",
            lw=0.8,
            color=colour,
            label=texts[name],
        )
    if survey.vessel is not None:
        for limit in (survey.vessel.thrust_min_n, survey.vessel.thrust_max_n):
            thrust.axhline(limit, color=GREY, lw=0.8, ls="--")
    thrust.set_ylabel(texts["thrust_axis"])
    thrust.set_xlabel(texts["time_axis"])
    thrust.legend(loc="upper right", ncols=2, fontsize=8.5, framealpha=0.9)
    return figure


@styled
def map_figure(survey: Survey, one: QuantityMap, samples: SampleTable) -> Figure:
    """Mean and standard deviation side by side, the samples on the second."""
    figure = Figure(figsize=(10.9, 4.0 * _aspect(survey) + 1.0))
    left, right = figure.subplots(1, 2)
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    _draw_field(figure, left, one, one.mean, "cividis", f"{one.quantity.label}{unit}")
    _draw_field(figure, right, one, one.sd, "magma_r", f"Standard deviation{unit}")
    points = samples.positions
    right.plot(points[:, 1], points[:, 0], ".", ms=1.5, color=SKY, alpha=0.7)
    for axes in (left, right):
        _draw_shore(axes, survey)
        _finish_map(axes, survey)
    right.set_ylabel("")
    return figure


@styled
def quantity_figure(
    data: ReportData, one: QuantityMap, thresholds: Sequence[Threshold], texts: Texts
) -> Figure:
    """All there is to see of a quantity: mean and standard deviation, and below them how it is
    distributed, the probability of concern, and the variogram.
    """
    figure = Figure(figsize=(10.9, 4.4 * _aspect(data.survey) + 4.3))
    grid = figure.add_gridspec(2, 6, height_ratios=(1.35 * _aspect(data.survey) + 0.3, 1))
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    left, right = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
    title = texts("mean_title", label=texts.label(one.quantity.key))
    _draw_field(figure, left, one, one.mean, "cividis", f"{title}{unit}")
    _hatch(left, one, _uncertain(one))
    _draw_field(figure, right, one, one.sd, "magma_r", f"{texts['sd_title']}{unit}")
    points = one.positions
    right.plot(points[:, 1], points[:, 0], ".", ms=1.2, color=SKY, alpha=0.7)
    for axes in (left, right):
        _draw_shore(axes, data.survey)
        _finish_map(axes, data.survey, texts["east"], texts["north"])
    right.set_ylabel("")
    _draw_histogram(figure.add_subplot(grid[1, :2]), one, thresholds, texts)
    middle = figure.add_subplot(grid[1, 2:4])
    if thresholds:
        _draw_concern(figure, middle, data.survey, one, thresholds, texts)
    else:
        middle.set_axis_off()
    _draw_variogram(figure.add_subplot(grid[1, 4:]), one, texts)
    return figure


def _uncertain(one: QuantityMap) -> NDArray:
    """1 where the 95 % error is larger than the map's range, from 5 to 95 % of its area."""
    low, high = np.nanpercentile(one.mean, [5, 95])
    return np.where(1.96 * one.sd > high - low, 1.0, 0.0)


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
    axes.set_xlabel(one.quantity.unit or one.quantity.label)


def _draw_concern(
    figure: Figure,
    axes: Axes,
    survey: Survey,
    one: QuantityMap,
    thresholds: Sequence[Threshold],
    texts: Texts,
) -> None:
    """The probability of the threshold that is the likeliest to be passed."""
    worst = max(thresholds, key=lambda each: float(np.nanmean(each.probability(one))))
    mesh = axes.pcolormesh(
        one.grid.east, one.grid.north, worst.probability(one), cmap="magma_r", vmin=0, vmax=1,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    figure.colorbar(mesh, ax=axes, shrink=0.8)
    _draw_shore(axes, survey)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(texts("concern_title", sense=texts[worst.sense], value=f"{worst.value:g}"))


def _draw_variogram(axes: Axes, one: QuantityMap, texts: Texts) -> None:
    empirical, model = one.fit.empirical, one.interpolator.model
    axes.plot(empirical.distance_m, empirical.semivariance, "o", ms=4, color=BLUE)
    h = np.linspace(empirical.distance_m[0] / 50, empirical.distance_m[-1], 200)
    for factor in (1.0, model.ratio) if model.ratio < 1 else (1.0,):
        axes.plot(h, model.variogram(h / factor), color=VERMILLION, lw=1.4)
    axes.set_ylim(bottom=0, top=1.35 * float(empirical.semivariance.max()) or None)
    axes.set_xlim(left=0)
    axes.set_title(texts["variogram_title"])
    axes.set_xlabel(texts["distance"])


@styled
def difference_figure(one: QuantityMap, change: Difference) -> Figure:
    """What changed, from blue (less) to red (more); hatched where it may be nothing."""
    figure = Figure(figsize=(6.4, 5.2))
    axes = figure.subplots()
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    most = float(np.nanmax(np.abs(change.mean))) or 1.0
    grid = one.grid
    mesh = axes.pcolormesh(
        grid.east, grid.north, change.mean, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    figure.colorbar(mesh, ax=axes, shrink=0.8)
    doubt = np.where(np.isfinite(change.mean), ~change.clear, False).astype(float)
    _hatch(axes, one, doubt)
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title(f"{one.quantity.label}: later less earlier{unit}")
    return figure


def _hatch(axes: Axes, one: QuantityMap, where: NDArray) -> None:
    """Hatch the nodes where a field of 0 and 1 is 1."""
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


def _draw_no_go(axes: Axes, survey: Survey) -> None:
    for i, zone in enumerate(survey.no_go):
        ring = np.asarray(zone.exterior.coords)
        label = "no-go" if i == 0 else None
        axes.fill(
            ring[:, 1], ring[:, 0], facecolor="none", edgecolor=BLACK, hatch="///", label=label
        )


def _draw_transits(axes: Axes, survey: Survey) -> None:
    """The way to each transit and from it: where the boat goes around land."""
    centres = np.array([t.set.centre for t in survey.targets])
    is_transit = np.array([t.kind == "transit" for t in survey.targets])
    if not is_transit.any():
        return
    near = is_transit | np.roll(is_transit, 1) | np.roll(is_transit, -1)
    gaps = np.where(near[:, None], centres, np.nan)
    axes.plot(gaps[:, 1], gaps[:, 0], color=ORANGE, lw=1.6, label="transits")
    places = centres[is_transit]
    axes.plot(places[:, 1], places[:, 0], ".", color=ORANGE, ms=4)


def _draw_direction(axes: Axes, centres: NDArray[np.float64]) -> None:
    """A few arrows along the way."""
    step = max(1, len(centres) // ARROWS)
    tails = centres[:-1:step]
    way = (centres[1:] - centres[:-1])[::step]
    axes.quiver(
        tails[:, 1], tails[:, 0], way[:, 1], way[:, 0], color=VERMILLION, angles="xy",
        scale_units="xy", scale=1, width=0.004, headwidth=6, headlength=7, headaxislength=6,
    )  # fmt: skip


def _draw_water(axes: Axes, survey: Survey) -> None:
    ring = np.asarray(survey.water.exterior.coords)
    axes.fill(ring[:, 1], ring[:, 0], color=SKY, alpha=0.25, lw=0)
    for island in survey.water.interiors:
        hole = np.asarray(island.coords)
        axes.fill(hole[:, 1], hole[:, 0], color="white", lw=0)
    _draw_shore(axes, survey)


def _draw_shore(axes: Axes, survey: Survey) -> None:
    for ring in (survey.water.exterior, *survey.water.interiors):
        points = np.asarray(ring.coords)
        axes.plot(points[:, 1], points[:, 0], color=BLACK, lw=0.9)


def _draw_start(axes: Axes, survey: Survey, label: str = "start") -> None:
    if survey.start is None:
        return
    axes.plot(
        survey.start.east_m,
        survey.start.north_m,
        marker="^",
        ms=9,
        color=BLACK,
        ls="",
        label=label,
        zorder=5,
    )


def _finish_map(
    axes: Axes, survey: Survey, east: str = "east [m]", north: str = "north [m]"
) -> None:
    axes.set_aspect("equal")
    axes.set_xlabel(east)
    axes.set_ylabel(north)
    north0, east0, north1, east1 = survey.water.bounds
    pad = 0.04 * max(north1 - north0, east1 - east0)
    if survey.start is not None:
        north0, north1 = min(north0, survey.start.north_m), max(north1, survey.start.north_m)
        east0, east1 = min(east0, survey.start.east_m), max(east1, survey.start.east_m)
    axes.set_xlim(east0 - pad, east1 + pad)
    axes.set_ylim(north0 - pad, north1 + pad)


def _size(survey: Survey) -> tuple[float, float]:
    """A figure's size for a map of this region, between wide and tall."""
    ratio = _aspect(survey)
    width = 6.4 if ratio <= 1 else 5.6
    return width, width * ratio * 0.82 + 1.1


def _aspect(survey: Survey) -> float:
    """Height over width of the region, held between wide and tall."""
    north0, east0, north1, east1 = survey.water.bounds
    return float(np.clip((north1 - north0) / (east1 - east0), 0.4, 1.6))


def png_bytes(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def save(figure: Figure, path: Path) -> Path:
    """Save a figure in the format that the path's ending names."""
    try:
        figure.savefig(path, dpi=DPI)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error}.") from None
    return path
