"""The yardstick: the minimum time for the same sets in the same order, planned all at once.

Every leg has its own stages and every stage its own duration, so the thrusts may switch at any
time. The entry into each set is required at the end of its leg, at a price far above any time it
could save. For a fair comparison the rest is as in `lookahead`: the surge stays below the window's
top on the way, at the same price, and each node is in the corridor of its leg, at the controller's
margin and price. The window is of the surge over ground for both, so a current does not move it.
The weather is known from the beginning. FATROP solves the problem, starting from flown tracks.

A plan counts only if it is a motion of the boat. If the integration steps are too long,
integration errors can drive a boat through a stage of seconds, and an optimiser exploits them.
"""

from __future__ import annotations

import math
import resource
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing import get_context

import numpy as np
import shapely

from grebe.control.controller import Controller, Margins
from grebe.control.horizon import Horizon, HorizonShape, Plan, rows_needed
from grebe.control.rules.base import Rule
from grebe.control.rules.lookahead import CORRIDOR_PENALTY, Lookahead, pace_rows
from grebe.control.solvers.base import Solver
from grebe.control.solvers.builders import Fatrop
from grebe.core.dynamics import CALM, Weather, drive_power_w, rates, rk4
from grebe.core.events import Reached
from grebe.core.sets import TargetSet, inner_rows
from grebe.core.vessel import Vessel
from grebe.mission.helm import Helm
from grebe.mission.trial import Conditions, Trial, simulate

STAGES_A_LEG = 5
MOST_ITERATIONS = 1000
# For one start: that of the paper's Fig. 7 takes 300 s; one of 195 cells has 2.7 GB of memory.
MOST_CPU_S = 900
AT_A_TIME = 2
# By how much a plan may be outside a set or corridor and still do the task [m, m/s].
LARGEST_MISS = 1e-3
# The most by which a stage may end elsewhere than the boat would [m, m/s, rad/s], and the steps
# of integration of that check [s].
LARGEST_ERROR, FINE_STEP_S = 0.02, 0.02
STILL = Conditions()
# A pull towards the last pace, loosened step by step, leads to the unpulled optimum.
PULLS = (2.0, 0.2, 0.0)


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is to be sailed: sets in their order, the corridor of each leg (empty: open water), by
    which boat, from which state, and in which weather, which the helm does not know.
    """

    vessel: Vessel
    targets: Sequence[TargetSet]
    start: Sequence[float]
    corridors: Sequence[shapely.Polygon] = ()
    weather: Weather = CALM

    def sailed(self, rule: Rule, conditions: Conditions = STILL, **kept: float) -> Trial:
        """Sail it by a rule, in the weather of the task; `kept` are margins that replace the
        usual.
        """
        helm = Controller(
            self.vessel, self.targets, rule, corridors=self.corridors, margins=Margins(**kept)
        )
        return self.sailed_by(helm, conditions)

    def sailed_by(self, helm: Helm, conditions: Conditions = STILL) -> Trial:
        """Sail it by a helm, in the weather of the task."""
        world = replace(conditions, weather=self.weather)
        return simulate(self.vessel, self.targets, helm, self.start, world)

    @property
    def corridor_rows(self) -> list[np.ndarray]:
        """Half-spaces of each corridor at the margin that the controller keeps."""
        return [inner_rows(one, Margins().corridor_m) for one in self.corridors]


@dataclass(frozen=True, kw_only=True)
class Optimum:
    """The plan, whether the solver `converged`, by how much it lies outside a set, and outside a
    corridor [m], and by how much a stage ends elsewhere than the boat would, at worst.
    """

    plan: Plan
    converged: bool
    outside_set: float
    outside_corridor_m: float
    off_motion: float
    energy_wh: float

    @property
    def counts(self) -> bool:
        """Whether it is an optimum of the task."""
        misses = max(self.outside_set, self.outside_corridor_m) >= LARGEST_MISS
        return self.converged and not misses and self.off_motion < LARGEST_ERROR

    @property
    def duration_s(self) -> float:
        """Minimum time [s]."""
        return self.plan.duration_s

    def __str__(self) -> str:
        converged = "converged" if self.converged else "not converged"
        return (
            f"{self.duration_s:.1f} s, {self.energy_wh:.2f} Wh ({converged}; at most "
            f"{self.outside_set:.0e} outside a set, {self.outside_corridor_m:.0e} m outside a "
            f"corridor, {self.off_motion:.0e} off the boat's motion)"
        )


def optimum(task: Task, guesses: Sequence[Plan], substeps: int) -> Optimum:
    """Return the least of the optima near some plans, which are flights as `as_plan` returns them.

    Which way the boat turns first and where it enters a cell are choices that a solver does not
    change. So an optimum is a local one, and more starts make a better yardstick. A plan that pays
    for missing a set or a corridor does another task and does not count.

    Raises `TimeoutError` if none is found; see `optima`.
    """
    found = optima([(task, guesses)], substeps)[0]
    if found is None:
        raise TimeoutError(f"No optimum was found in {MOST_CPU_S} s of CPU.")
    return found


def optima(asked: Sequence[tuple[Task, Sequence[Plan]]], substeps: int) -> list[Optimum | None]:
    """Return the optimum of each task, as `optimum` does, several at a time; None where none is
    found.

    Each start runs in a process of its own with a limit on its CPU time, because from a few starts
    FATROP never leaves one iteration.
    """
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        waiting = [
            [pool.submit(_found_alone, task, guess, substeps) for guess in guesses]
            for task, guesses in asked
        ]
        found = [[job.result() for job in jobs] for jobs in waiting]
    return [
        min(
            (one for one in some if one is not None),
            key=lambda one: (not one.counts, one.duration_s),
            default=None,
        )
        for some in found
    ]


def _found_alone(task: Task, guess: Plan, substeps: int) -> Optimum | None:
    """The optimum near a guess, or None if its process exceeded its limit."""
    with ProcessPoolExecutor(1, get_context("spawn"), _may_take, (MOST_CPU_S,)) as process:
        try:
            return process.submit(_found, task, guess, substeps).result()
        except BrokenProcessPool:
            return None


def _may_take(cpu_s: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))


def _found(task: Task, guess: Plan, substeps: int) -> Optimum:
    horizon = _horizon(task, substeps)
    solver = Fatrop(most_iterations=MOST_ITERATIONS).build(task.vessel, horizon.shape)
    return _judged(task, horizon, *_descended(solver, task, horizon, guess))


def _judged(task: Task, horizon: Horizon, plan: Plan, converged: bool) -> Optimum:
    """A plan with its errors, as an `Optimum`."""
    return Optimum(
        plan=plan,
        converged=converged,
        outside_set=max(
            target.distance(plan.states[STAGES_A_LEG * leg])
            for leg, target in enumerate(task.targets, 1)
        ),
        outside_corridor_m=_outside_corridors(horizon, plan),
        off_motion=off_motion(task, plan),
        energy_wh=_energy_wh(task, plan),
    )


def _horizon(task: Task, substeps: int) -> Horizon:
    """The whole survey as one horizon, with what each leg's stages require."""
    corridors = task.corridor_rows
    shape = HorizonShape(
        stages=STAGES_A_LEG * len(task.targets),
        set_rows=rows_needed([len(target.vertices) for target in task.targets]),
        corridor_rows=max(map(len, corridors), default=0),
        substeps=substeps,
    )
    horizon = Horizon(shape=shape)
    horizon.duration_bounds[:] = (0.01, 3.0)
    horizon.time_weights[:] = 1.0
    horizon.effort_weights[:] = 1e-5
    horizon.corridor_penalty = CORRIDOR_PENALTY
    for leg, target in enumerate(task.targets):
        begin, end = STAGES_A_LEG * leg, STAGES_A_LEG * (leg + 1)
        horizon.require(end, target.halfspaces, 1e3)
        horizon.attract(slice(begin, end), pace_rows(target), Lookahead().hold)
        for node in range(begin + 1, end + 1) if corridors else ():
            horizon.confine(node, corridors[leg])
    return horizon


def _descended(solver: Solver, task: Task, horizon: Horizon, guess: Plan) -> tuple[Plan, bool]:
    """The plan nearest to the optimum that the solver reached, and whether it converged."""
    solved, weather = False, np.array(task.weather.as_tuple())
    for pull in PULLS:
        horizon.duration_nominal[:] = guess.durations
        horizon.duration_weights[:] = pull
        solution = solver.solve(guess.states[0], horizon, weather, guess)
        solved = solution.solved
        if solved:
            guess = solution.plan
    return guess, solved


def _outside_corridors(horizon: Horizon, plan: Plan) -> float:
    """How far outside its corridor the plan lies at worst [m]."""
    rows = horizon.corridors[1:]
    excess = np.einsum("nri,ni->nr", rows[..., :3], plan.states[1:][:, [0, 1, 3]]) - rows[..., 3]
    return float(np.max(excess, initial=0.0))


def off_motion(task: Task, plan: Plan) -> float:
    """By how much a stage of a plan ends elsewhere than the boat would, integrated finely: the
    largest difference of place [m], velocities [m/s] and yaw rate [rad/s].
    """
    weather, worst = task.weather.as_tuple(), 0.0
    for k, (seconds, thrusts) in enumerate(zip(plan.durations, plan.thrusts, strict=True)):

        def derivative(state, thrusts=thrusts):
            return rates(task.vessel, state, thrusts, weather)

        steps = max(1, math.ceil(seconds / FINE_STEP_S))
        end = rk4(derivative, plan.states[k].tolist(), float(seconds), steps)
        worst = max(worst, float(np.abs(np.subtract(end, plan.states[k + 1])).max()))
    return worst


def _energy_wh(task: Task, plan: Plan) -> float:
    """Energy of the drives for a plan, by momentum theory as in a mission's report."""
    joules = sum(
        drive_power_w(task.vessel, thrusts, surge) * seconds
        for thrusts, surge, seconds in zip(
            plan.thrusts, plan.states[:-1, 3], plan.durations, strict=True
        )
    )
    return float(joules) / 3600


def as_plan(task: Task, flight: Trial) -> Plan:
    """A flight that reached every set, resampled on the legs' stages: a plan to start from."""
    times, states = flight.track[:, 0], flight.track[:, 1:]
    entries = [0.0]
    for event in flight.recorder.of(Reached):
        entries.append(max(event.elapsed_s, entries[-1] + 0.1))
    moments = np.concatenate(
        [np.linspace(a, b, STAGES_A_LEG, endpoint=False) for a, b in pairwise(entries)]
        + [[entries[-1]]]
    )
    sampled = np.column_stack([np.interp(moments, times, column) for column in states.T])
    cruise = 0.5 * task.vessel.surge_drag_n(1.5)
    return Plan(
        states=sampled,
        thrusts=np.full((len(moments) - 1, 2), cruise),
        durations=np.diff(moments),
    )
