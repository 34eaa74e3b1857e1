"""Draw the paper's figures: east to the right and north up, like Grebe's own pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from grebe.core.quantities import BUILTIN
from grebe.core.sets import TargetSet
from grebe.core.survey import Survey
from grebe.mapping.quantity_map import QuantityMap
from grebe.mission.trial import Trial
from grebe.paper import scenes
from grebe.report.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, styled

if TYPE_CHECKING:
    import shapely
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from grebe.paper.claim import Score

LABELLED_SETS = 12


@styled
def mirrored(pair: Sequence[scenes.Scene], trials: Sequence[Trial], parting_s: float) -> Figure:
    """Fig. 1: both paths and both tracks, and where the second mode begins."""
    figure = Figure(figsize=(8.4, 5.2))
    axes = figure.subplots()
    paths = zip(pair, trials, ("\u03a9", "\u03a8"), (BLUE, VERMILLION), strict=True)
    for scene, trial, letter, colour in paths:
        # Both paths share the first set, so each has its label on its own side of it.
        _draw_sets(axes, scene.targets, letter, colour, aside=1 if letter == "\u03a9" else -1)
        track = np.array(trial.track)
        axes.plot(track[:, 2], track[:, 1], color=colour, label=f"track along {letter}")
    first = np.array(trials[0].track)
    place = first[np.searchsorted(first[:, 0], parting_s - 1e-9)]
    axes.plot(place[2], place[1], "o", color=BLACK, ms=6, label="second mode begins")
    return _finished(figure, axes, pair[0].start, "Fig. 1: two mirrored paths (sets: stand-ins)")


@styled
def paths(scene: scenes.Scene, trial: Trial) -> Figure:
    """Fig. 2: the sets and the track through them."""
    figure = Figure(figsize=(8.4, 4.4))
    axes = figure.subplots()
    _draw_sets(axes, scene.targets, "\u03a9", BLUE)
    track = np.array(trial.track)
    axes.plot(track[:, 2], track[:, 1], color=VERMILLION, label="track")
    return _finished(
        figure,
        axes,
        scene.start,
        "Fig. 2: four sets, the third touched at its rim (sets: stand-ins)",
    )


@styled
def exploration(scene: scenes.Scene, trial: Trial) -> Figure:
    """Fig. 7: the region, its cells and the track through all of them."""
    figure = Figure(figsize=(9.0, 6.4))
    axes = figure.subplots()
    ring = np.asarray(scenes.region().exterior.coords)
    axes.fill(ring[:, 1], ring[:, 0], color=SKY, alpha=0.25, lw=0)
    axes.plot(ring[:, 1], ring[:, 0], color=BLACK, lw=1.0)
    _draw_sets(axes, scene.targets, "", GREY)
    track = np.array(trial.track)
    axes.plot(track[:, 2], track[:, 1], color=VERMILLION, lw=1.2, label="track")
    title = f"Fig. 7: {trial.arrivals} sets (region: a stand-in)"
    return _finished(figure, axes, scene.start, title)


@styled
def histories(
    scene: scenes.Scene,
    trial: Trial,
    window: tuple[float, float],
    span_s: float,
    title: str,
) -> Figure:
    """Figs. 8 and 9: thrusts with their limits and surge with its window."""
    track, thrusts = np.array(trial.track), np.array(trial.thrusts)
    shown = track[:, 0] <= span_s
    time = track[shown, 0]
    figure = Figure(figsize=(9.0, 6.4))
    port, starboard, speed = figure.subplots(3, 1, sharex=True)
    low, high = scene.vessel.thrust_min_n, scene.vessel.thrust_max_n
    sides = ((port, "F\u2081 port [N]", BLUE), (starboard, "F\u2082 starboard [N]", GREEN))
    for column, (axes, name, colour) in enumerate(sides):
        axes.step(time, thrusts[shown, column], where="post", color=colour, lw=1.1)
        for limit in (low, high):
            axes.axhline(limit, color=BLACK, lw=0.8, ls="--")
        axes.set_ylabel(name)
    speed.axhspan(*window, color=ORANGE, alpha=0.25, lw=0, label="window of the sets")
    speed.plot(time, track[shown, 4], color=VERMILLION, lw=1.2, label="surge u")
    speed.set_ylabel("u [m/s]")
    speed.set_xlabel("time [s]")
    speed.legend(loc="lower right", frameon=False, ncols=2)
    port.set_title(f"{title}: thrusts and surge, window {window[0]:g} to {window[1]:g} m/s")
    return figure


@styled
def hand_track(lonlat: NDArray[np.float64], hull: shapely.Polygon) -> Figure:
    """Fig. 4: the hand-operated trajectory in decimal coordinates, and the region it spans."""
    figure = Figure(figsize=(7.2, 5.4))
    axes = figure.subplots()
    ring = np.asarray(hull.exterior.coords)
    axes.fill(ring[:, 0], ring[:, 1], color=SKY, alpha=0.25, lw=0, label="region")
    axes.plot(lonlat[:, 0], lonlat[:, 1], color=BLUE, lw=0.9, label="track")
    axes.plot(*lonlat[0], "^", color=BLACK, ms=8, label="start")
    axes.set_aspect(1 / np.cos(np.radians(lonlat[:, 1].mean())))
    axes.ticklabel_format(useOffset=False)
    axes.tick_params(axis="x", rotation=20)
    axes.set_xlabel("longitude [deg]")
    axes.set_ylabel("latitude [deg]")
    axes.set_title("Fig. 4: the hand-operated trajectory")
    axes.legend(loc="best", frameon=False)
    return figure


@styled
def quantity_map(survey: Survey, one: QuantityMap) -> Figure:
    """Fig. 5: the map of one quantity over the region."""
    figure = Figure(figsize=(7.2, 5.4))
    axes = figure.subplots()
    grid = one.grid
    mesh = axes.pcolormesh(
        grid.east, grid.north, one.mean, cmap="cividis", shading="nearest", rasterized=True
    )
    figure.colorbar(mesh, ax=axes, label=f"{one.quantity.label} [{one.quantity.unit}]")
    axes.plot(one.positions[:, 1], one.positions[:, 0], ".", ms=1, color=BLACK, alpha=0.4)
    ring = np.asarray(survey.water.exterior.coords)
    axes.plot(ring[:, 1], ring[:, 0], color=BLACK, lw=0.9)
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title(f"Fig. 5: {one.quantity.label.lower()}, from the hand-operated samples")
    return figure


@styled
def planned(survey: Survey) -> Figure:
    """Fig. 6: the cells and the path through their centres."""
    figure = Figure(figsize=(7.2, 5.4))
    axes = figure.subplots()
    _draw_sets(axes, survey.sets, "", BLUE)
    centres = np.array([target.set.centre for target in survey.targets])
    axes.plot(centres[:, 1], centres[:, 0], color=VERMILLION, lw=1.1, label="order")
    ring = np.asarray(survey.water.exterior.coords)
    axes.plot(ring[:, 1], ring[:, 0], color=BLACK, lw=0.9)
    axes.plot(centres[0, 1], centres[0, 0], "^", color=BLACK, ms=8, label="first")
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title("Fig. 6: squares of 100 m²")
    axes.legend(loc="best", frameon=False)
    return figure


@styled
def claim(scores: Sequence[Score]) -> Figure:
    """RMSE of each map over that of the hand-driven one, a box for each quantity and plan."""
    methods = list(dict.fromkeys(score.method for score in scores))
    keys = list(dict.fromkeys(score.quantity for score in scores))
    figure = Figure(figsize=(8.0, 4.6))
    axes = figure.subplots()
    base = {(s.quantity, s.seed): s.rmse for s in scores if s.method == methods[0]}
    for j, (method, colour) in enumerate(zip(methods[1:], (BLUE, VERMILLION), strict=False)):
        ratios = [
            [s.rmse / base[key, s.seed] for s in scores if s.method == method and s.quantity == key]
            for key in keys
        ]
        boxes = axes.boxplot(
            ratios, positions=np.arange(len(keys)) + 0.3 * j - 0.15, widths=0.24, patch_artist=True,
            medianprops={"color": BLACK},
        )  # fmt: skip
        for box in boxes["boxes"]:
            box.set_facecolor(colour)
            box.set_alpha(0.6)
        axes.plot([], [], color=colour, lw=6, alpha=0.6, label=method)
    axes.axhline(1.0, color=BLACK, lw=0.9, ls="--", label=methods[0])
    labels = {key: one.label for key, one in BUILTIN.items()}
    axes.set_xticks(range(len(keys)), [labels[key] for key in keys])
    axes.set_ylabel("RMSE over that of the track by hand")
    axes.set_ylim(bottom=0)
    axes.set_title("The same water, sampled by hand and by plan")
    axes.legend(loc="best", frameon=False)
    return figure


def _draw_sets(
    axes: Axes, targets: Sequence[TargetSet], letter: str, colour: str, *, aside: int = 0
) -> None:
    """Draw sets with their numbers in the middle. The number of the first set can be put `aside`,
    to the east (1) or to the west (-1).
    """
    corners = [np.asarray(target.vertices)[:, ::-1] for target in targets]
    axes.add_collection(
        PolyCollection(corners, facecolors="none", edgecolors=colour, linewidths=0.9)
    )
    if not letter or len(targets) > LABELLED_SETS:
        return
    for i, target in enumerate(targets, start=1):
        north, east = target.centre
        if aside and i == 1:
            east += aside * (target.polygon.bounds[3] - target.polygon.bounds[1])
        axes.annotate(f"${letter}_{i}$", (east, north), ha="center", va="center", color=colour)


def _finished(figure: Figure, axes: Axes, start: scenes.State, title: str) -> Figure:
    axes.plot(start[1], start[0], "^", color=BLACK, ms=8, label="start")
    axes.set_aspect("equal")
    axes.margins(0.05)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title(title)
    axes.legend(loc="best", frameon=False)
    return figure
