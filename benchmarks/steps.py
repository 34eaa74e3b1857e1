"""A control step: time and reliability against the baseline, and the time to get ready."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import cache

from benchmarks.common import (
    BOAT,
    CELLS,
    START,
    grebe_flight,
    median_p95_max,
    print_head,
    print_row,
)
from benchmarks.dompc import DoMpcPilot
from benchmarks.rebuilt import RebuiltPilot
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.solvers.builders import Fatrop
from grebe.control.turn_and_go import model_substeps
from grebe.mission.helm import Helm
from grebe.mission.trial import Trial, simulate

GET_READY = """
import time
began = time.perf_counter()
from grebe.control.controller import Controller
from grebe.core.sets import rectangle
from grebe.core.vessel import PRESETS
cells = [rectangle((0, 5), (5 * k, 5 * k + 5), (1, 2)) for k in range(9)]
controller = Controller(PRESETS["benchmark"], cells)
controller.step((-10, 2, 0, 0, 0, 0))
print(time.perf_counter() - began)
"""

BASELINE = "Opti + IPOPT, hard sets, rebuilt each step"
DO_MPC = "do-mpc, the same problem"
FATROP = "Grebe `dual`, FATROP"
DUAL = "Grebe `dual`, fast"
LOOKAHEAD = "Grebe `lookahead`, fast"


def _peer(pilot: Callable[..., Helm]) -> Trial:
    return simulate(BOAT, CELLS, pilot(BOAT, CELLS, Dual(), model_substeps(BOAT, 1.0)), START)


FLIGHTS: dict[str, Callable[[], Trial]] = {
    BASELINE: lambda: _peer(RebuiltPilot),
    DO_MPC: lambda: _peer(DoMpcPilot),
    FATROP: lambda: grebe_flight(Dual(), Fatrop()),
    DUAL: lambda: grebe_flight(Dual()),
    LOOKAHEAD: lambda: grebe_flight(Lookahead()),
}


@cache
def flight(name: str) -> Trial:
    """The flight of the 100 cells by one of the controllers, at most once a run."""
    return FLIGHTS[name]()


def ratios(name: str) -> list[float]:
    """Median, 95 % and largest time of the baseline's steps, each over that of a controller's."""
    base, own = median_p95_max(flight(BASELINE).step_ms), median_p95_max(flight(name).step_ms)
    return [b / o for b, o in zip(base, own, strict=True)]


def steps() -> None:
    print_head(
        "A control step, 100 cells",
        "controller", "reached", "mission s", "median / p95 / max ms", "not solved", "ratios",
    )  # fmt: skip
    for name in FLIGHTS:
        sailed = flight(name)
        print_row(
            name,
            sailed.report.reached,
            f"{sailed.duration_s:.1f}",
            " / ".join(f"{ms:.2f}" for ms in median_p95_max(sailed.step_ms)),
            f"{sailed.report.unsolved_steps} of {len(sailed.step_ms)}",
            " / ".join(f"{ratio:.1f}" for ratio in ratios(name)),
        )
    seconds = [
        float(
            subprocess.run(
                [sys.executable, "-c", GET_READY], capture_output=True, check=True
            ).stdout
        )
        for _ in range(5)
    ]
    print(f"\nImport, build and first step in a new process: {min(seconds):.2f} s at best of five.")
