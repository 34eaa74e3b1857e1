"""A control step: time and reliability against the baseline, and the time to get ready."""

from __future__ import annotations

import subprocess
import sys

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
from grebe.control.controller import model_substeps
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.solvers.builders import Fatrop
from grebe.mission.trial import fly

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


def steps() -> None:
    rule, substeps = Dual(), model_substeps(BOAT, 1.0)
    flights = {
        "Opti + IPOPT, hard sets, rebuilt each step": fly(
            BOAT, CELLS, RebuiltPilot(BOAT, CELLS, rule, substeps), START
        ),
        "do-mpc, the same problem": fly(
            BOAT, CELLS, DoMpcPilot(BOAT, CELLS, rule, substeps), START
        ),
        "Grebe `dual`, FATROP": grebe_flight(Dual(), Fatrop()),
        "Grebe `dual`, fast": grebe_flight(Dual()),
        "Grebe `lookahead`, fast": grebe_flight(Lookahead()),
    }
    print_head(
        "A control step, 100 cells",
        "controller", "reached", "mission s", "median / p95 / max ms", "not solved", "ratios",
    )  # fmt: skip
    base = median_p95_max(next(iter(flights.values())).step_ms)
    for name, flight in flights.items():
        own = median_p95_max(flight.step_ms)
        ratios = [b / o for b, o in zip(base, own, strict=True)]
        print_row(
            name,
            flight.report.reached,
            f"{flight.duration_s:.1f}",
            " / ".join(f"{ms:.2f}" for ms in own),
            f"{flight.report.unsolved_steps} of {len(flight.step_ms)}",
            " / ".join(f"{ratio:.1f}" for ratio in ratios),
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
