"""Where the time over the optimum goes: the same flights with one condition changed at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from benchmarks.common import print_head, print_row
from benchmarks.missions import (
    CLOSER_M,
    CURRENT_MPS,
    NOISE,
    cells_task,
    lake_task,
    towards_each,
)
from benchmarks.optimum import STILL, Task
from grebe.control.controller import Command, Controller
from grebe.control.rules.lookahead import Lookahead
from grebe.core.dynamics import CALM, Weather
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, Trial

LONGER, OFTENER = Lookahead(stages=36), Lookahead(step_s=0.25)
Sails = Callable[[Task, Conditions], Trial]


class Informed(Controller):
    """The controller with the weather known from the beginning."""

    def __init__(self, task: Task) -> None:
        super().__init__(task.vessel, task.targets, Lookahead(), corridors=task.corridors)
        self._truth = task.weather

    def step(self, state, weather: Weather = CALM, elapsed_s: float | None = None) -> Command:
        """Return the thrusts for the true weather, whatever the estimate is."""
        return super().step(state, self._truth, elapsed_s)


def losses() -> None:
    tasks = {"100 cells": cells_task(), "lake": lake_task()}
    print_head("Seconds of `lookahead` in still water", "changed", *tasks)
    for name, sail in IN_STILL_WATER.items():
        print_row(name, *(_seconds([sail(task, STILL)]) for task in tasks.values()))
    print_head(
        f"Seconds of `lookahead` in a current of {CURRENT_MPS} m/s, mean / worst of a flight "
        "towards each direction",
        "changed", *tasks,
    )  # fmt: skip
    for name, (sail, world, moves) in IN_CURRENTS.items():
        print_row(name, *(_seconds(_four(task, sail, world, moves)) for task in tasks.values()))


def _usual(task: Task, world: Conditions) -> Trial:
    return task.sailed(Lookahead(), world)


def _closer(task: Task, world: Conditions) -> Trial:
    return task.sailed(Lookahead(), world, set_m=CLOSER_M)


def _longer(task: Task, world: Conditions) -> Trial:
    return task.sailed(LONGER, world)


def _more(task: Task, world: Conditions) -> Trial:
    """With at least four stages for a leg instead of two: fewer legs in one horizon."""
    with patch("grebe.control.rules.lookahead.FEWEST_STAGES", 4):
        return _usual(task, world)


def _raw(task: Task, world: Conditions) -> Trial:
    """With every estimate unfiltered, although its noise is known."""
    with patch("grebe.control.state_filter.StateFilter.filtered", lambda _, state: state):
        return _usual(task, world)


def _slower(task: Task, world: Conditions) -> Trial:
    """With half the window's lower end: a corner may be touched at half the speed."""
    halved = [replace(one, speed_min_mps=0.5 * one.speed_min_mps) for one in task.targets]
    return _usual(replace(task, targets=halved), world)


def _spared(task: Task, world: Conditions) -> Trial:
    """With a window that ends at 1.5 m/s: both thrusters together have thrust to spare."""
    slower = [replace(one, speed_max_mps=1.5) for one in task.targets]
    return _usual(replace(task, targets=slower), world)


def _told(task: Task, world: Conditions) -> Trial:
    return task.sailed_by(Informed(task), world)


IN_STILL_WATER: dict[str, Sails] = {
    "nothing": _usual,
    "0.05 m inside the sets instead of 0.1": _closer,
    "at the corridors' sides instead of 0.3 m inside": lambda task, world: task.sailed(
        Lookahead(), world, corridor_m=0.0
    ),
    "no corridors": lambda task, world: _usual(replace(task, corridors=()), world),
    "36 stages instead of 24": _longer,
    "a step each 0.25 s instead of 0.5": lambda task, world: task.sailed(OFTENER, world),
    "a window from 0.5 m/s instead of 1": _slower,
    "a window to 1.5 m/s instead of 2": _spared,
    "four stages a leg at least instead of two": _more,
}
NOISY = Conditions(errors=NOISE)
QUIETER = Conditions(errors=EstimateErrors(velocity_mps=0.01))
# Each with its conditions, and whether there is a current.
IN_CURRENTS: dict[str, tuple[Sails, Conditions, bool]] = {
    "nothing": (_usual, NOISY, True),
    "no noise": (_usual, STILL, True),
    "no current": (_usual, NOISY, False),
    "no current, noise of 0.01 m/s": (_usual, QUIETER, False),
    "no current, a window to 1.5 m/s instead of 2": (_spared, NOISY, False),
    "no current, a window from 0.5 m/s instead of 1": (_slower, NOISY, False),
    "known current": (_told, NOISY, True),
    "known current, no noise": (_told, STILL, True),
    "0.05 m inside the sets": (_closer, NOISY, True),
    "four stages a leg at least": (_more, NOISY, True),
    "unfiltered estimates": (_raw, NOISY, True),
    "no current, unfiltered estimates": (_raw, NOISY, False),
}


def _four(task: Task, sail: Sails, world: Conditions, moves: bool) -> list[Trial]:
    """One flight towards each direction, each with its own noise."""
    return [
        sail(replace(one, weather=one.weather if moves else CALM), replace(world, seed=seed))
        for seed, one in enumerate(towards_each(task).values())
    ]


def _seconds(flights: list[Trial]) -> str:
    """Mean and worst of the complete flights, and how many were not complete."""
    times = [flight.duration_s for flight in flights if flight.complete]
    lost = len(flights) - len(times)
    told = f"{np.mean(times):.1f}" if times else "-"
    worst = f" / {max(times):.1f}" if len(times) > 1 else ""
    return told + worst + (f", {lost} of {len(flights)} not complete" if lost else "")
