"""Run the benchmarks: `python -m benchmarks [NAME ...]`; each prints a table in Markdown.

Times are CPU times of one process; what counts are the ratios within a run.
"""

from __future__ import annotations

import importlib
import os
import platform
import sys
from importlib.metadata import version

# One thread: what a small boat's computer would give.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Each with the module that holds it. One is imported when it is run: the peers of another need not
# be installed for it.
BENCHMARKS = {
    "steps": "steps",
    "missions": "missions",
    "thrift": "thrift",
    "losses": "losses",
    "agreement": "agreement",
    "robustness": "robustness",
    "sets": "sets",
    "planning": "planning",
    "lakes": "planning",
    "cores": "cores",
    "routes": "routes",
    "sorties": "sorties",
    "mapping": "mapping",
    "skewed": "skewed",
    "holdout": "holdout",
    "identification": "identification",
    "mismatch": "mismatch",
    "autopilot": "autopilot",
    "soak": "soak",
    "latency": "soak",
    "survival": "survival",
    "fleet_survival": "survival",
    "campaigns": "campaign",
    "adaptive": "adaptive",
    "exploring": "exploring",
    "commands": "commands",
    "missions_a_second": "commands",
    "first_run": "commands",
}


def main() -> None:
    packages = ", ".join(f"{name} {version(name)}" for name in ("casadi", "numba", "numpy"))
    print(f"Python {platform.python_version()}, {packages}; {os.cpu_count()} cores, noisy.")
    for name in sys.argv[1:] or BENCHMARKS:
        getattr(importlib.import_module(f"benchmarks.{BENCHMARKS[name]}"), name)()


if __name__ == "__main__":
    main()
