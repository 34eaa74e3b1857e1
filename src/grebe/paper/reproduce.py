"""Reproduce the paper's figures about control: each is sailed in simulation, drawn, and checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.rules.lookahead import Lookahead
from grebe.control.solvers.builders import Fast
from grebe.core.sets import TargetSet
from grebe.core.vessel import Vessel
from grebe.mission.trial import Trial
from grebe.paper import drawings, scenes
from grebe.paper.checks import Check, Reproduction
from grebe.report.canvas import save

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Tracks this close count as the same: the solver's tolerance, after half a minute of sailing.
SAME_TRACK_M = 0.01
# A track touches a rim if it goes in by less than this share of the distance from rim to middle.
RIM_SHARE = 0.5
SPAN_S = 100.0


def fig1(out: Path, boat: Vessel = scenes.BOAT) -> Reproduction:
    """Two mirrored paths: the same track until the second mode, mirrored after it."""
    pair = scenes.mirrored_paths(boat)
    trials = [scene.sailed() for scene in pair]
    first, second = (np.array(trial.track) for trial in trials)
    parting = _second_mode_s(trials[0], pair[0].rule.stages)
    before = first[:, 0] <= parting + 1e-9
    shared = min(len(first), len(second))
    same = _apart(first[before], second[: len(first)][before])
    mirrored = _apart(first[:shared], second[:shared] * [1, 1, -1, -1, 1, -1, -1])
    after = _apart(first[:shared][~before[:shared]], second[:shared][~before[:shared]])
    picture = save(drawings.mirrored(pair, trials, parting), out / "fig1.png")
    return Reproduction(
        figure="fig1",
        picture=picture,
        checks=(
            *(
                _all_reached(name, f)
                for name, f in zip(("path", "its mirror"), trials, strict=True)
            ),
            Check(
                what=f"largest distance of the tracks before the second mode, at {parting:.0f} s",
                found=f"{same:.1e} m",
                holds=same <= SAME_TRACK_M,
            ),
            Check(
                what="largest distance of one track from the mirror image of the other",
                found=f"{mirrored:.1e} m",
                holds=mirrored <= SAME_TRACK_M,
            ),
            Check(
                what="largest distance of the tracks after it",
                found=f"{after:.1f} m",
                holds=after > 10.0,
            ),
        ),
    )


def fig2(out: Path, boat: Vessel = scenes.BOAT) -> Reproduction:
    """Four sets, the third of which is touched only at its rim."""
    scene = scenes.four_sets(boat)
    trial = scene.sailed()
    depths = [_depth(target, trial) for target in scene.targets]
    half = 0.5 * min(np.ptp(np.array(scene.targets[2].vertices), axis=0).tolist())
    picture = save(drawings.paths(scene, trial), out / "fig2.png")
    rim = Check(
        what=f"how far the track goes into the third set, {half:.0f} m from rim to middle",
        found=f"{depths[2]:.2f} m",
        holds=0 <= depths[2] < RIM_SHARE * half,
    )
    return Reproduction(figure="fig2", picture=picture, checks=(_all_reached("path", trial), rim))


def fig7(out: Path, boat: Vessel = scenes.BOAT) -> Reproduction:
    """The region explored: every set is reached at least once; also with the rule `lookahead`."""
    scene = scenes.exploration(boat=boat)
    trial = scene.sailed()
    further = scenes.sailed_with(scene, Lookahead(), Fast()).sailed()
    picture = save(drawings.exploration(scene, trial), out / "fig7.png")
    return Reproduction(
        figure="fig7",
        picture=picture,
        checks=(
            _all_reached("dual", trial),
            _within_thrusts(scene, trial),
            Check(
                what="the same by `lookahead`, beyond the paper",
                found=f"{further.arrivals} in {further.duration_s:.0f} s",
                holds=further.complete,
            ),
        ),
    )


def fig8(out: Path, boat: Vessel = scenes.BOAT) -> Reproduction:
    """Surge and thrusts for the window [1, 2] m/s."""
    return _window_figure("fig8", scenes.WINDOW_1_2, out, boat)


def fig9(out: Path, boat: Vessel = scenes.BOAT) -> Reproduction:
    """Surge and thrusts for the window [0.5, 1.5] m/s."""
    return _window_figure("fig9", scenes.WINDOW_HALF, out, boat)


FIGURES: dict[str, Callable[[Path, Vessel], Reproduction]] = {
    "fig1": fig1,
    "fig2": fig2,
    "fig7": fig7,
    "fig8": fig8,
    "fig9": fig9,
}


def _window_figure(name: str, window: tuple[float, float], out: Path, boat: Vessel) -> Reproduction:
    scene = scenes.exploration(window, boat)
    trial = scene.sailed()
    entries = _entries(scene.targets, trial)
    speeds = np.array([speed for _, speed in entries])
    within = sum(when <= SPAN_S for when, _ in entries)
    title = f"Fig. {name.removeprefix('fig')}"
    picture = save(drawings.histories(scene, trial, window, SPAN_S, title), out / f"{name}.png")
    return Reproduction(
        figure=name,
        picture=picture,
        checks=(
            Check(
                what=f"surge at the entry of each of {len(entries)} sets, window "
                f"{window[0]:g} to {window[1]:g} m/s",
                found=f"{speeds.min():.2f} to {speeds.max():.2f} m/s; between them, where "
                f"problem (8) asks nothing of it, in the window for "
                f"{_share_within(trial, window):.0%} of the time",
                holds=len(entries) == len(scene.targets)
                and bool(np.all((speeds >= window[0]) & (speeds <= window[1]))),
            ),
            Check(
                what=f"sets reached in the first {SPAN_S:.0f} s",
                found=str(within),
                holds=within > 0,
            ),
            _within_thrusts(scene, trial),
        ),
    )


def _all_reached(name: str, trial: Trial) -> Check:
    return Check(
        what=f"sets reached ({name})",
        found=f"{trial.arrivals} in {trial.duration_s:.0f} s, "
        f"{trial.report.unsolved_steps} steps not solved",
        holds=trial.complete and trial.report.unsolved_steps == 0,
    )


def _within_thrusts(scene: scenes.Scene, trial: Trial) -> Check:
    thrusts = np.array(trial.thrusts)
    low, high = scene.vessel.thrust_min_n, scene.vessel.thrust_max_n
    return Check(
        what=f"thrusts, limits {low:g} to {high:g} N",
        found=f"{thrusts.min():.2f} to {thrusts.max():.2f} N",
        holds=bool(thrusts.min() >= low and thrusts.max() <= high),
    )


def _share_within(trial: Trial, window: tuple[float, float]) -> float:
    """The share of the time shown during which the surge is in its window."""
    time, surge = trial.track[:, 0], trial.track[:, 4]
    shown = surge[time <= SPAN_S]
    return float(np.mean((shown >= window[0]) & (shown <= window[1])))


def _second_mode_s(trial: Trial, horizon: int) -> float:
    """The time at which the second mode begins, when N_x first falls below N [s]."""
    return next(step.elapsed_s for step in trial.steps if (step.split_stage or 0) < horizon)


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest distance of two tracks at equal times [m]."""
    return float(np.max(np.hypot(*(a[:, 1:3] - b[:, 1:3]).T)))


def _depth(target: TargetSet, trial: Trial) -> float:
    """How far the track goes into a footprint [m]; negative if it stays outside."""
    sides = target.halfspaces[:-2]
    places = np.array(trial.track)[:, 1:3]
    return float(np.max(-np.max(places @ sides[:, :2].T - sides[:, 3], axis=1)))


def _entries(targets: Sequence[TargetSet], trial: Trial) -> list[tuple[float, float]]:
    """The time at which each set was reached [s], and the surge then [m/s]."""
    entries: list[tuple[float, float]] = []
    for when, *state in trial.track:
        while len(entries) < len(targets) and targets[len(entries)].contains(state):
            entries.append((when, state[3]))
    return entries
