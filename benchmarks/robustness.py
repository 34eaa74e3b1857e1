"""Missions from random starts in weather that the controller does not know."""

from __future__ import annotations

from multiprocessing import Pool

import numpy as np

from benchmarks.common import BOAT, print_head, print_row
from grebe.control.controller import Controller
from grebe.core.dynamics import Weather
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, meander, simulate
from grebe.workflow.steering_names import rule_named

MISSIONS = 200


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
    pilot = Controller(BOAT, cells, rule_named(rule))
    flight = simulate(
        BOAT,
        cells,
        pilot,
        start,
        Conditions(
            weather=weather, errors=EstimateErrors(velocity_mps=0.02), seed=seed, limit_s=900
        ),
    )
    return flight.complete, flight.report.unsolved_steps, len(flight.step_ms)


def robustness() -> None:
    """Missions completed of 200 random starts in weather that the controller does not know."""
    print_head(
        f"Missions completed of {MISSIONS}, 40 cells, weather unknown, noise 0.02 m/s",
        "rule", "current m/s", "wind force, of full thrust", "completed", "steps not solved",
    )  # fmt: skip
    cases = [("lookahead", 0.3, 0.0), ("lookahead", 0.5, 0.0), ("lookahead", 0.0, 0.25)]
    cases += [("lookahead", 0.5, 0.25), ("dual", 0.3, 0.0)]
    with Pool(2) as pool:
        for rule, current, wind in cases:
            jobs = [(rule, current, wind, seed) for seed in range(MISSIONS)]
            sailed = pool.map(_random_mission, jobs, chunksize=5)
            done = sum(complete for complete, _, _ in sailed)
            unsolved, total = sum(u for _, u, _ in sailed), sum(n for _, _, n in sailed)
            print_row(f"`{rule}`", current, wind, f"{done} of {MISSIONS}", f"{unsolved} of {total}")
