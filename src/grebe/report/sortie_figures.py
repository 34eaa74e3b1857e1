"""A picture of a plan in sorties: the cells of each, and its path."""

from __future__ import annotations

import numpy as np
from matplotlib import patheffects
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from grebe.core.revision import PlanRevision, Sortie, survey_of
from grebe.core.survey import Survey
from grebe.report.canvas import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    SKY,
    VERMILLION,
    draw_no_go,
    draw_water,
    figure_size,
    finish_map,
    legend_below,
    styled,
)

# Okabe and Ito's colours, in an order in which neighbours differ in lightness too; beyond six
# sorties they repeat, hatched.
COLOURS = (ORANGE, BLUE, "#F0E442", GREEN, SKY, VERMILLION)
HATCHES = ("", "////", "....", "xxxx")
MANY_CELLS = 3_000


@styled
def sorties_figure(survey: Survey, revision: PlanRevision) -> Figure:
    """The cells in the colours of their sorties, and each sortie's path, number and harbour."""
    figure = Figure(figsize=figure_size(survey))
    axes = figure.subplots()
    draw_water(axes, survey)
    many = len(revision.targets) > MANY_CELLS
    fleet = survey.fleet
    comes_back = fleet is None or (survey.settings and survey.settings.sorties)

    def whose(one: Sortie) -> str:
        return f"{one.number}, {survey.whose(one.boat)}" if fleet else str(one.number)

    outline: list[patheffects.AbstractPathEffect] = [
        patheffects.withStroke(linewidth=3, foreground="white")
    ]
    for i, sortie in enumerate(revision.sorties):
        part = survey_of(survey, revision, sortie)
        cells = [t for t in part.targets if t.kind == "cell"]
        axes.add_collection(
            PolyCollection(
                [np.asarray(t.set.vertices)[:, ::-1] for t in cells],
                facecolors=COLOURS[i % len(COLOURS)],
                edgecolors="none" if many else "white",
                hatch=HATCHES[i // len(COLOURS) % len(HATCHES)],
                linewidths=0.4,
                alpha=0.75,
                label=f"{whose(sortie)}: {sortie.time_s / 60:.0f} min, {sortie.energy_wh:.0f} Wh",
            )
        )
        start = (sortie.start.north_m, sortie.start.east_m)
        path = np.array([start, *(t.set.centre for t in part.targets)])
        axes.plot(path[:, 1], path[:, 0], color=BLACK, lw=0.4 if many else 0.7, alpha=0.8)
        middle = np.median([t.set.centre for t in cells], axis=0)
        nearest = min(cells, key=lambda t: float(np.hypot(*(t.set.centre - middle))))
        north, east = nearest.set.centre
        text = axes.text(
            east, north, str(sortie.number), ha="center", va="center", weight="bold", size=14
        )
        text.set_path_effects(outline)
    draw_no_go(axes, survey)
    places = {(s.start.east_m, s.start.north_m) for s in revision.sorties}
    axes.plot(
        *np.array(sorted(places)).T, marker="^", ls="none", ms=10, color=BLACK, mec="white",
        label="harbour" if comes_back else "start", zorder=5,
    )  # fmt: skip
    parts = f"{len(revision.sorties)} sorties" + (f" of {fleet.boats} boats" if fleet else "")
    axes.set_title(f"{survey.name}: {parts}")
    finish_map(axes, survey)
    legend_below(axes)
    return figure
