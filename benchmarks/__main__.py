"""Run the benchmarks: `python -m benchmarks [NAME ...]`; each prints a table in Markdown.

Times are CPU times of one process; what counts are the ratios within a run.
"""

from __future__ import annotations

import os
import platform
import sys
from importlib.metadata import version
from multiprocessing import Pool

# One thread: what a small boat's computer would give.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.flights import Flight, GrebePilot, fly, meander
from benchmarks.optimum import optimum
from benchmarks.peers import LineOfSightPilot, set_point_controller
from benchmarks.rebuilt import RebuiltPilot
from grebe.control.controller import Controller, model_substeps
from grebe.control.settings import paper_settings, settings_for
from grebe.control.solve import CasadiSolver
from grebe.dynamics import Weather
from grebe.vessel import PRESETS

BOAT = PRESETS["benchmark"]
START = (-10.0, 2.5, 0.0, 0.0, 0.0, 0.0)
CELLS = meander()
MISSIONS = 200


def grebe_flight(rule: str, solver: str) -> Flight:
    settings = settings_for(rule, solver=solver)
    warm = GrebePilot(Controller(BOAT, CELLS[:2], settings))
    fly(BOAT, CELLS[:2], warm, START, limit_s=5.0)
    return fly(BOAT, CELLS, GrebePilot(Controller(BOAT, CELLS, settings)), START, observe=True)


def steps() -> None:
    """A control step: time and reliability against the baseline."""
    print("\n## A control step, 100 cells\n")
    settings = paper_settings()
    rebuilt = RebuiltPilot(BOAT, CELLS, settings, model_substeps(BOAT, 1.0))
    flights = {"Opti + IPOPT, hard sets, rebuilt each step": fly(BOAT, CELLS, rebuilt, START)}
    for rule, solver in (("dual", "fatrop"), ("dual", "fast"), ("lookahead", "fast")):
        flights[f"Grebe `{rule}`, {solver}"] = grebe_flight(rule, solver)
    base = np.array(next(iter(flights.values())).step_ms)
    print("| controller | reached | mission s | median / p95 / max ms | not solved | ratios |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, flight in flights.items():
        ms = np.array(flight.step_ms)
        figures = [np.median, lambda x: np.percentile(x, 95), np.max]
        own, ratio = [f(ms) for f in figures], [f(base) / f(ms) for f in figures]
        print(
            f"| {name} | {flight.reached} | {flight.duration_s:.1f} | "
            f"{own[0]:.2f} / {own[1]:.2f} / {own[2]:.1f} | "
            f"{flight.unsolved} of {len(ms)} | {ratio[0]:.1f} / {ratio[1]:.1f} / {ratio[2]:.1f} |"
        )


def missions() -> None:
    """Mission time over the optimum, for Grebe's rules and the peers."""
    print("\n## Mission time over the optimum, 100 cells\n")
    lookahead = grebe_flight("lookahead", "fast")
    best, worst, solved = optimum(BOAT, CELLS, lookahead, 3)
    finer, _, _ = optimum(BOAT, CELLS, lookahead, 6)
    print(
        f"Optimum {best:.1f} s (converged: {solved}, largest violation of a set {worst:.1e}; "
        f"with half the integration step {finer:.1f} s).\n"
    )
    settings = paper_settings()
    flights = {
        "Grebe `lookahead`": lookahead,
        "Grebe `dual`": grebe_flight("dual", "fast"),
        "set-point NMPC on the centres": fly(
            BOAT, CELLS, GrebePilot(set_point_controller(BOAT, CELLS, settings)), START
        ),
        "waypoints, line of sight, PID": fly(
            BOAT, CELLS, LineOfSightPilot(BOAT, CELLS, stopping=False), START
        ),
        "the same, stopping at each turn": fly(
            BOAT, CELLS, LineOfSightPilot(BOAT, CELLS, stopping=True), START
        ),
    }
    print("| controller | reached | mission s | over the optimum |")
    print("| --- | --- | --- | --- |")
    for name, flight in flights.items():
        over = f"{flight.duration_s / best:.3f}" if flight.complete else "-"
        print(f"| {name} | {flight.reached} of 100 | {flight.duration_s:.1f} | {over} |")


class Recorder:
    """Passes on what a controller asks its solver and keeps it."""

    name = "recorder"

    def __init__(self, inner) -> None:
        self.inner, self.asked = inner, []

    def solve(self, state, horizon, weather, guess):
        self.asked.append((state, horizon, weather, guess))
        return self.inner.solve(state, horizon, weather, guess)


def agreement(instances: int = 500) -> None:
    """First input of the fast path against IPOPT from the same start, on recorded instances."""
    print("\n## The fast path against the oracle, form D\n")
    recorder = None
    rng = np.random.default_rng(7)
    asked = []
    while len(asked) < 2 * instances:
        controller = Controller(BOAT, CELLS, paper_settings())
        recorder = Recorder(controller._solver)
        controller._solver = recorder
        place = rng.uniform(-60, 60, 2)
        start = (*place, rng.uniform(-np.pi, np.pi), 0, 0, 0)
        fly(BOAT, CELLS, GrebePilot(controller), start, limit_s=80, observe=False)
        asked += recorder.asked
    chosen = [asked[i] for i in rng.choice(len(asked), instances, replace=False)]
    shape = chosen[0][1].shape
    from grebe.control.fast.solver import FastSolver
    from grebe.control.ocp import build

    fast, oracle = FastSolver(BOAT, shape), CasadiSolver(build(BOAT, shape), "ipopt")
    reach = BOAT.thrust_max_n - BOAT.thrust_min_n
    same_start, near_optimum, solved, cheaper = 0, 0, 0, 0
    for state, horizon, weather, guess in chosen:
        ours = fast.solve(state, horizon, weather, guess)
        exact = oracle.solve(state, horizon, weather, guess)
        refined = oracle.solve(state, horizon, weather, ours.plan)
        solved += ours.solved
        same_start += _apart(ours, exact) < 0.01 * reach
        near_optimum += _apart(ours, refined) < 0.01 * reach
        cheaper += ours.cost <= exact.cost * (1 + 1e-4) + 1e-4
    share = 100 / instances
    print("| of 500 instances | % |")
    print("| --- | --- |")
    print(f"| converged | {share * solved:.1f} |")
    print(
        f"| first input within 1 % of the range of IPOPT's, same start | {share * same_start:.1f} |"
    )
    print(f"| the same, IPOPT started from our plan | {share * near_optimum:.1f} |")
    print(f"| cost no higher than IPOPT's from the same start | {share * cheaper:.1f} |")


def _apart(a, b) -> float:
    return float(np.abs(np.subtract(a.plan.first_input, b.plan.first_input)).max())


def _random_mission(job: tuple[str, float, float, int]) -> tuple[bool, int, int]:
    rule, current, wind, seed = job
    rng = np.random.default_rng(seed)
    around, where, heading, wind_from = rng.uniform(0, 2 * np.pi, 4)
    radius = 100 * np.sqrt(rng.uniform())
    force = wind * 2 * BOAT.thrust_max_n
    weather = Weather(
        current_north_mps=current * np.cos(around),
        current_east_mps=current * np.sin(around),
        wind_force_north_n=force * np.cos(wind_from),
        wind_force_east_n=force * np.sin(wind_from),
    )
    cells = meander(rows=4)
    start = (radius * np.cos(where), radius * np.sin(where), heading, 0, 0, 0)
    pilot = GrebePilot(Controller(BOAT, cells, settings_for(rule)))
    flight = fly(
        BOAT, cells, pilot, start, weather=weather, velocity_noise=0.02, seed=seed, limit_s=900
    )
    return flight.complete, flight.unsolved, len(flight.step_ms)


def robustness() -> None:
    """Missions completed of 200 random starts in weather that the controller is not told."""
    print(f"\n## Missions completed of {MISSIONS}, 40 cells, weather unknown, noise 0.02 m/s\n")
    print("| rule | current m/s | wind force, of full thrust | completed | steps not solved |")
    print("| --- | --- | --- | --- | --- |")
    cases = [("lookahead", 0.3, 0.0), ("lookahead", 0.5, 0.0), ("lookahead", 0.0, 0.25)]
    cases += [("lookahead", 0.5, 0.25), ("dual", 0.3, 0.0)]
    with Pool(2) as pool:
        for rule, current, wind in cases:
            jobs = [(rule, current, wind, seed) for seed in range(MISSIONS)]
            flown = pool.map(_random_mission, jobs, chunksize=5)
            done = sum(complete for complete, _, _ in flown) / MISSIONS
            unsolved, total = sum(u for _, u, _ in flown), sum(n for _, _, n in flown)
            print(f"| {rule} | {current} | {wind} | {done:.1%} | {unsolved} of {total} |")
            sys.stdout.flush()


BENCHMARKS = {
    "steps": steps,
    "missions": missions,
    "agreement": agreement,
    "robustness": robustness,
}


def main() -> None:
    packages = ", ".join(f"{name} {version(name)}" for name in ("casadi", "numba", "numpy"))
    print(f"Python {platform.python_version()}, {packages}; {os.cpu_count()} cores, noisy.")
    for name in sys.argv[1:] or BENCHMARKS:
        BENCHMARKS[name]()


if __name__ == "__main__":
    main()
