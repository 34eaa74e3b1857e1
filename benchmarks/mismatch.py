"""How much longer a survey takes if the boat or its estimates differ from their description."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from multiprocessing import Pool

import numpy as np

from benchmarks.common import print_head, print_row
from grebe.control.controller import Controller
from grebe.core.sets import TargetSet, rectangle
from grebe.core.vessel import PRESETS, Vessel
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, meander, simulate
from grebe.simulation.changing import Gusts, Tide

LIMIT_S = 1500.0
Start = tuple[float, float, float, float, float, float]


def scaled(boat: Vessel, factor: float, *names: str) -> Vessel:
    """A boat with some of its parameters multiplied."""
    return replace(boat, **{name: factor * getattr(boat, name) for name in names})


MASSES = ("m11_kg", "m22_kg", "m33_kgm2")
DRAGS = ("x_u", "x_uu", "y_v", "y_vv", "n_r", "n_rr")


def conditions(case: str, boat: Vessel, seed: int) -> Conditions:
    """The world of a case."""
    late = EstimateErrors(late_s=0.8)
    return {
        "as the model": Conditions(),
        "mass + 30 %": Conditions(boat=scaled(boat, 1.3, *MASSES)),
        "mass - 30 %": Conditions(boat=scaled(boat, 0.7, *MASSES)),
        "drag x 2": Conditions(boat=scaled(boat, 2.0, *DRAGS)),
        "drag x 0.5": Conditions(boat=scaled(boat, 0.5, *DRAGS)),
        "thrusters lag by 1 s": Conditions(boat=replace(boat, thruster_lag_s=1.0)),
        "estimates 0.8 s late, age known": Conditions(errors=late),
        "estimates 0.8 s late, age unknown": Conditions(errors=replace(late, says_age=False)),
        "port thruster 40 % weaker": Conditions(effectiveness=(0.6, 1.0)),
        "compass off by 10 deg": Conditions(
            errors=EstimateErrors(heading_bias_rad=float(np.radians(10)))
        ),
        "position noise 0.5 m": Conditions(errors=EstimateErrors(position_m=0.5), seed=seed),
        "tide of 0.4 m/s that turns": Conditions(
            weather=Tide(current_mps=0.4, period_s=120.0, bearing_rad=0.5 + seed)
        ),
        "gusts": Conditions(
            weather=Gusts(
                mean_north_n=0.1 * boat.thrust_max_n, sd_n=0.15 * boat.thrust_max_n, seed=seed
            )
        ),
    }[case]


CASES = (
    "as the model", "mass + 30 %", "mass - 30 %", "drag x 2", "drag x 0.5", "thrusters lag by 1 s",
    "estimates 0.8 s late, age known", "estimates 0.8 s late, age unknown",
    "port thruster 40 % weaker", "compass off by 10 deg", "position noise 0.5 m",
    "tide of 0.4 m/s that turns", "gusts",
)  # fmt: skip


def winding(side: float = 6.0, speed: tuple[float, float] = (0.5, 1.5)) -> list[TargetSet]:
    """Eighteen cells in another order than `meander`: round about, there and back."""
    places = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 3), (2, 3), (3, 3), (3, 2), (3, 1), (3, 0),
              (2, 0), (2, 1), (2, 2), (1, 2), (1, 1), (1, 0), (4, 0), (4, 2)]  # fmt: skip
    return [
        rectangle((side * n, side * (n + 1)), (side * e, side * (e + 1)), speed) for n, e in places
    ]


WAYS: dict[str, tuple[str, Callable[[], list[TargetSet]], Start]] = {
    "spyboat, 18 cells there and back": (
        "spyboat", lambda: meander(rows=3, columns=6), (-5.0, 2.0, 0.0, 0.0, 0.0, 0.0),
    ),
    "blueboat, 18 cells round about": (
        "blueboat", winding, (-6.0, 3.0, 0.5, 0.0, 0.0, 0.0),
    ),
}  # fmt: skip


def duration_s(job: tuple[str, str, int]) -> float:
    """The duration of a mission; infinite if it does not complete."""
    way, case, seed = job
    name, cells, start = WAYS[way]
    boat, sets = PRESETS[name], cells()
    world = replace(conditions(case, boat, seed), limit_s=LIMIT_S)
    trial = simulate(boat, sets, Controller(boat, sets), start, world)
    return trial.duration_s if trial.complete else np.inf


def mismatch(seeds: int = 3) -> None:
    """Time over that of a boat equal to its model, worst of some seeds in brackets."""
    cases = list(CASES)
    jobs = [(way, case, seed) for way in WAYS for case in cases for seed in range(seeds)]
    with Pool(2) as pool:
        times = dict(zip(jobs, pool.map(duration_s, jobs, chunksize=1), strict=True))
    print_head("Time over that of the model's own boat, median (worst)", "", *WAYS)
    for case in cases:
        row: list[str] = []
        for way in WAYS:
            base = times[way, cases[0], 0]
            ratios = [times[way, case, seed] / base for seed in range(seeds)]
            row.append(f"{np.median(ratios):.2f} ({max(ratios):.2f})")
        print_row(case, *row)
