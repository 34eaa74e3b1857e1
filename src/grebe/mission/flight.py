"""A mission in simulation without a file: for experiments, figures and benchmarks.

The plant, the weather, the noise and the rule of entry (every estimate, ten a second) are the
same for whoever steers, so that pilots can be compared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from grebe.control.controller import Controller
from grebe.control.observer import Observer
from grebe.control.rules.base import reached_count
from grebe.core.dynamics import CALM, Weather
from grebe.core.sets import TargetSet, rectangle
from grebe.core.vessel import Vessel
from grebe.simulation.plant import Plant

ESTIMATE_S = 0.1

Thrusts = tuple[float, float]
State = Sequence[float]


@dataclass(kw_only=True)
class Flight:
    """What came of a mission.

    `track` rows are (time [s], the true state); `thrusts` what was commanded at each of them;
    `decisions` rows are (time [s], target, split stage N_x); `step_ms` is CPU time of the
    pilot alone, `unsolved` counts the steps that it could not solve.
    """

    targets: int
    reached: int = 0
    duration_s: float = 0.0
    unsolved: int = 0
    step_ms: list[float] = field(default_factory=list)
    track: list[tuple[float, ...]] = field(default_factory=list)
    thrusts: list[Thrusts] = field(default_factory=list)
    decisions: list[tuple[float, int, int]] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether every target was reached."""
        return self.reached == self.targets


@dataclass(frozen=True, kw_only=True)
class Steering:
    """A pilot's answer: thrusts as a function of the time since, whether its problem was
    solved, and the split stage N_x where there is one.
    """

    thrusts_at: Callable[[float], Thrusts]
    solved: bool = True
    split: int = 0


class Pilot(Protocol):
    """Steers: `decide` is asked every `step_s`."""

    step_s: float

    def decide(self, state: State, reached: int, weather: Weather) -> Steering:
        """Return the thrusts from now on, `reached` sets being reached."""
        ...


class GrebePilot:
    """Grebe's controller as a pilot."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.step_s = controller.rule.step_s

    def decide(self, state: State, reached: int, weather: Weather) -> Steering:
        """See `Pilot`."""
        self.controller.reached = reached
        command = self.controller.step(state, weather)
        return Steering(
            thrusts_at=command.thrusts_at, solved=command.status.is_solved, split=command.split
        )


@dataclass(frozen=True, kw_only=True)
class FlightSettings:
    """The world of a flight: the weather, which the pilot is not told, the standard deviation of
    the measured velocities, when to give up, and whether an observer helps the pilot.
    """

    weather: Weather = CALM
    velocity_noise_mps: float = 0.0
    seed: int = 0
    limit_s: float = 1000.0
    observe: bool = True


def fly(
    vessel: Vessel,
    targets: Sequence[TargetSet],
    pilot: Pilot,
    start: State,
    settings: FlightSettings | None = None,
) -> Flight:
    """Fly from `start` (6,) until every set is reached or the time is up."""
    world = settings or FlightSettings()
    rng = np.random.default_rng(world.seed)
    north, east, heading, surge, sway, yaw_rate = start
    plant = Plant(vessel, (north, east, heading, surge, sway, yaw_rate), world.weather)
    observer = Observer(vessel)
    flight = Flight(targets=len(targets))
    next_step, since, steering = 0.0, 0.0, Steering(thrusts_at=lambda _: (0.0, 0.0))
    before: list[float] | None = None
    thrusts = (0.0, 0.0)
    while True:
        state = _estimate(plant.state, world.velocity_noise_mps, rng)
        flight.track.append((plant.time_s, *plant.state))
        flight.reached = reached_count(targets, flight.reached, state)
        if flight.complete or plant.time_s > world.limit_s:
            flight.duration_s = plant.time_s
            flight.thrusts.append(thrusts)
            return flight
        if before is not None and world.observe:
            observer.update(before, thrusts, state, ESTIMATE_S)
        if plant.time_s >= next_step - 1e-9:
            began = time.process_time()
            steering = pilot.decide(state, flight.reached, observer.weather)
            flight.step_ms.append(1e3 * (time.process_time() - began))
            flight.unsolved += not steering.solved
            flight.decisions.append((plant.time_s, flight.reached, steering.split))
            next_step, since = plant.time_s + pilot.step_s, plant.time_s
        thrusts = steering.thrusts_at(plant.time_s - since)
        flight.thrusts.append(thrusts)
        plant.command(thrusts)
        before = state
        plant.advance(ESTIMATE_S)


def _estimate(state: list[float], noise_mps: float, rng: np.random.Generator) -> list[float]:
    """The true state with noise on its velocities; positions are far better known."""
    if not noise_mps:
        return list(state)
    return state[:3] + (np.array(state[3:]) + noise_mps * rng.normal(size=3)).tolist()


def meander(
    rows: int = 10,
    columns: int = 10,
    side: float = 5.0,
    speed: tuple[float, float] = (1.0, 2.0),
) -> list[TargetSet]:
    """Return square cells there and back: by default the 100 sets that benchmarks fly."""
    return [
        rectangle((side * c, side * (c + 1)), (side * r, side * (r + 1)), speed)
        for r in range(rows)
        for c in (range(columns) if r % 2 == 0 else range(columns - 1, -1, -1))
    ]
