"""Run the benchmarks: `python -m benchmarks [NAME ...]`; each prints a table in Markdown.

Times are CPU times of one process; what counts are the ratios within a run.
"""

from __future__ import annotations

import os
import platform
import sys
from importlib.metadata import version

# One thread: what a small boat's computer would give.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.agreement import agreement
from benchmarks.autopilot import autopilot
from benchmarks.campaign import campaigns
from benchmarks.cores import cores
from benchmarks.holdout import holdout
from benchmarks.identification import identification
from benchmarks.mapping import mapping
from benchmarks.mismatch import mismatch
from benchmarks.missions import missions
from benchmarks.planning import lakes, planning
from benchmarks.robustness import robustness
from benchmarks.routes import routes
from benchmarks.sets import sets
from benchmarks.soak import latency, soak
from benchmarks.sorties import sorties
from benchmarks.steps import steps
from benchmarks.survival import survival

BENCHMARKS = {
    f.__name__: f
    for f in (
        steps,
        missions,
        agreement,
        robustness,
        sets,
        planning,
        lakes,
        cores,
        routes,
        sorties,
        mapping,
        holdout,
        identification,
        mismatch,
        autopilot,
        soak,
        latency,
        survival,
        campaigns,
    )
}


def main() -> None:
    packages = ", ".join(f"{name} {version(name)}" for name in ("casadi", "numba", "numpy"))
    print(f"Python {platform.python_version()}, {packages}; {os.cpu_count()} cores, noisy.")
    for name in sys.argv[1:] or BENCHMARKS:
        BENCHMARKS[name]()


if __name__ == "__main__":
    main()
