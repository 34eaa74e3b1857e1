"""What all pictures share: style, colours, the water and its shore, and saving.

East is to the right and north is up. Lines have Okabe-Ito colours, which the colour-blind can
distinguish.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter
from matplotlib.transforms import offset_copy

from grebe.core.survey import Survey
from grebe.io.atomic_write import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from grebe.report.texts import Texts

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
# The height above a map that its scale bar and north arrow take [pt].
BAND_PT = 20.0


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw in Grebe's style and leave matplotlib's settings unchanged."""

    def wrapped(*args: Any, **options: Any) -> Figure:
        with mpl.rc_context(cast(Any, STYLE)):
            return draw(*args, **options)

    wrapped.__doc__ = draw.__doc__
    return wrapped


class Numbers(ScalarFormatter):
    """The numbers of an axis, written as in a language."""

    def __init__(self, texts: Texts) -> None:
        super().__init__()
        self._texts = texts

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the text of a tick."""
        return self._texts.number(super().__call__(x, pos))

    def get_offset(self) -> str:
        """Return the power of ten, or what was subtracted, of all ticks."""
        return self._texts.number(super().get_offset())


def localise(figure: Figure, texts: Texts) -> Figure:
    """Write the numbers of all axes, including colour bars', as in a language."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(Numbers(texts))
    return figure


def draw_water(axes: Axes, survey: Survey) -> None:
    """Fill the water and draw its shore."""
    ring = np.asarray(survey.water.exterior.coords)
    axes.fill(ring[:, 1], ring[:, 0], color=SKY, alpha=0.25, lw=0)
    for island in survey.water.interiors:
        hole = np.asarray(island.coords)
        axes.fill(hole[:, 1], hole[:, 0], color="white", lw=0)
    draw_shore(axes, survey)


def draw_shore(axes: Axes, survey: Survey) -> None:
    """Draw the outlines of the water and of its islands."""
    for ring in (survey.water.exterior, *survey.water.interiors):
        points = np.asarray(ring.coords)
        axes.plot(points[:, 1], points[:, 0], color=BLACK, lw=0.9)


def draw_no_go(axes: Axes, survey: Survey) -> None:
    """Hatch the no-go zones."""
    for i, zone in enumerate(survey.no_go):
        ring = np.asarray(zone.exterior.coords)
        label = "no-go" if i == 0 else None
        axes.fill(
            ring[:, 1], ring[:, 0], facecolor="none", edgecolor=BLACK, hatch="///", label=label
        )


def draw_start(axes: Axes, survey: Survey, label: str = "start") -> None:
    """Mark where the boat starts."""
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


def finish_map(
    axes: Axes, survey: Survey, east: str = "east [m]", north: str = "north [m]"
) -> None:
    """Label a map's axes and fit them to the water and the start."""
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
    _draw_scale(axes)


def title_above(figure: Figure, text: str) -> None:
    """Write a title above all that a finished figure holds.

    The layout knows nothing of the band above a map, so the title of the map may reach beyond the
    figure. Where it does is known only once the figure has been laid out.
    """
    figure.draw_without_rendering()
    tops = [axes.get_tightbbox() for axes in figure.axes]
    highest = max((box.y1 for box in tops if box is not None), default=0.0)
    figure.suptitle(text, x=0.01, y=max(1.0, highest / figure.bbox.height), ha="left", va="bottom")


def legend_below(axes: Axes) -> None:
    """Add a legend below the map and its axis labels."""
    handles, labels = axes.get_legend_handles_labels()
    cast(Figure, axes.get_figure()).legend(
        handles, labels, loc="outside lower center", ncols=3, frameon=False
    )


def legend_above(axes: Axes, **more: Any) -> None:
    """Add a legend above the right end: inside, it could cover curves or look like one."""
    where = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    axes.legend(**{**where, "ncols": 2, "frameon": False, **more})


def _draw_scale(axes: Axes) -> None:
    """Draw a scale bar of a round length and a north arrow above the map's right end, below the
    title, which may be long. Distances are in points, because the map of a wide lake is low.
    """
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=BAND_PT)
    left, right = axes.get_xlim()
    width = right - left
    tens = 10.0 ** np.floor(np.log10(width / 4))
    length = max(share * tens for share in (1.0, 2.0, 5.0) if share * tens <= width / 4)
    figure = cast(Figure, axes.get_figure())
    above = offset_copy(axes.get_xaxis_transform(), figure, y=0.35 * BAND_PT, units="points")
    end = right - 0.05 * width
    axes.plot(
        [end - length, end], [1.0, 1.0], transform=above, color=BLACK, lw=2.2, clip_on=False,
        solid_capstyle="butt",
    )  # fmt: skip
    text = f"{length / 1000:g} km" if length >= 1000 else f"{length:g} m"
    axes.text(
        end - 1.06 * length, 1.0, text, transform=above, fontsize="x-small", ha="right",
        va="center", clip_on=False,
    )  # fmt: skip
    axes.annotate(
        "N", xy=(0.99, 1.0), xytext=(0, 0.1 * BAND_PT), xycoords="axes fraction",
        textcoords="offset points", ha="center", va="bottom", fontsize="x-small",
        annotation_clip=False,
    )  # fmt: skip
    arrow = offset_copy(axes.transAxes, figure, y=0.65 * BAND_PT, units="points")
    axes.plot([0.99], [1.0], transform=arrow, marker="^", ms=4, color=BLACK, ls="", clip_on=False)


def figure_size(survey: Survey) -> tuple[float, float]:
    """The size of a figure for a map of this region."""
    ratio = aspect(survey)
    width = 6.4 if ratio <= 1 else 5.6
    return width, width * ratio * 0.82 + 1.1


def aspect(survey: Survey) -> float:
    """Height over width of the region, limited so that its map is neither too wide nor too tall."""
    north0, east0, north1, east1 = survey.water.bounds
    return float(np.clip((north1 - north0) / (east1 - east0), 0.4, 1.6))


def _quiet_about_glyphs() -> None:
    """Silence warnings about letters that the font lacks: the boxes drawn for them show it."""
    warnings.filterwarnings("ignore", message="Glyph .* missing from font")


def png_bytes(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    _quiet_about_glyphs()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, bbox_inches="tight")
    return buffer.getvalue()


def save(figure: Figure, path: Path) -> Path:
    """Save a figure in the format given by the path's suffix."""
    _quiet_about_glyphs()
    with written_whole(path) as part:
        figure.savefig(part, dpi=DPI, bbox_inches="tight")
    return path
