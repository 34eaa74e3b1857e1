"""Fly one mission in simulation without a file: what every benchmark compares.

The plant, the weather, the noise and the rule of entry (every estimate, ten a second) are the
same for whoever steers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from grebe.control.observer import Observer
from grebe.control.rules import reached_count
from grebe.dynamics import CALM, Weather
from grebe.sets import TargetSet, rectangle
from grebe.simulation.plant import Plant
from grebe.vessel import Vessel

ESTIMATE_S = 0.1

Thrusts = tuple[float, float]


@dataclass
class Flight:
    """What came of a mission; `step_ms` is CPU time of the controller alone."""

    reached: int = 0
    targets: int = 0
    duration_s: float = 0.0
    unsolved: int = 0
    step_ms: list[float] = field(default_factory=list)
    track: list[tuple[float, ...]] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        return self.reached == self.targets


class Pilot:
    """Steers: `decide` is asked every `step_s` and returns thrusts as a function of time."""

    step_s: float

    def see(self, state: Sequence[float]) -> None:
        """Be told of every estimate."""

    def decide(
        self, state: Sequence[float], reached: int, weather: Weather
    ) -> tuple[Callable[[float], Thrusts], bool]:
        """Return the thrusts from now on and whether the step was solved."""
        raise NotImplementedError


class GrebePilot(Pilot):
    """Grebe's controller behind the benchmark's page."""

    def __init__(self, controller) -> None:
        self.controller = controller
        self.step_s = controller.settings.step_s

    def decide(self, state, reached, weather):
        self.controller.reached = reached
        command = self.controller.step(state, weather)
        return command.thrusts_at, command.status.is_solved


def fly(
    vessel: Vessel,
    targets: Sequence[TargetSet],
    pilot: Pilot,
    start: Sequence[float],
    *,
    weather: Weather = CALM,
    velocity_noise: float = 0.0,
    seed: int = 0,
    limit_s: float = 1000.0,
    observe: bool = True,
) -> Flight:
    """Fly until every set is reached or `limit_s` has passed."""
    rng = np.random.default_rng(seed)
    plant = Plant(vessel, tuple(start), weather)
    observer = Observer(vessel)
    flight = Flight(targets=len(targets))
    next_step, since = 0.0, 0.0
    schedule = lambda _: (0.0, 0.0)  # noqa: E731
    before, thrusts = None, (0.0, 0.0)
    while True:
        state = list(plant.state)
        if velocity_noise:
            state[3:] = (np.array(state[3:]) + velocity_noise * rng.normal(size=3)).tolist()
        flight.track.append((plant.time_s, *plant.state))
        flight.reached = reached_count(targets, flight.reached, state)
        if flight.complete or plant.time_s > limit_s:
            flight.duration_s = plant.time_s
            return flight
        if before is not None and observe:
            observer.update(before, thrusts, state, ESTIMATE_S)
        if plant.time_s >= next_step - 1e-9:
            began = time.process_time()
            schedule, solved = pilot.decide(state, flight.reached, observer.weather)
            flight.step_ms.append(1e3 * (time.process_time() - began))
            flight.unsolved += not solved
            next_step, since = plant.time_s + pilot.step_s, plant.time_s
        thrusts = schedule(plant.time_s - since)
        plant.command(thrusts)
        before = state
        plant.advance(ESTIMATE_S)


def meander(
    rows: int = 10,
    columns: int = 10,
    side: float = 5.0,
    speed: tuple[float, float] = (1.0, 2.0),
) -> list[TargetSet]:
    """Return square cells there and back, the benchmark's 100 sets by default."""
    return [
        rectangle((side * c, side * (c + 1)), (side * r, side * (r + 1)), speed)
        for r in range(rows)
        for c in (range(columns) if r % 2 == 0 else range(columns - 1, -1, -1))
    ]
