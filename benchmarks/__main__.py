"""Run the benchmarks: `python -m benchmarks [NAME ...]`; each prints a table in Markdown.

Without a name the summary of all goals is run; `all` runs all the others, which takes many hours.
Times are CPU times of one process; compare the ratios within a run.
"""

from __future__ import annotations

import importlib
import os
import platform
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# One thread, as on a small boat's computer.
os.environ.setdefault("OMP_NUM_THREADS", "1")

PACKAGES = ("grebe", "casadi", "numba", "numpy", "shapely", "do-mpc", "ortools")

# Each benchmark with its module. A module is imported only when its benchmark runs, so the peers of
# the others need not be installed.
BENCHMARKS = {
    "summary": "summary",
    "steps": "steps",
    "missions": "missions",
    "noisy": "noisy",
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
    "changing": "changing",
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
    "maps": "whole_maps",
}


SUMMARY, ALL = "summary", "all"


def main() -> None:
    names = sys.argv[1:] or [SUMMARY]
    if names == [ALL]:
        names = [name for name in BENCHMARKS if name != SUMMARY]
    if unknown := set(names) - set(BENCHMARKS):
        names_known = ", ".join([ALL, *BENCHMARKS])
        raise SystemExit(f"No benchmark {', '.join(sorted(unknown))}; there are {names_known}.")
    print(machine(), flush=True)
    # Imported here, because it reads the limit on threads.
    from grebe.workflow.kernel_cache import compile_controller

    compile_controller()
    for name in names:
        getattr(importlib.import_module(f"benchmarks.{BENCHMARKS[name]}"), name)()


def machine() -> str:
    """The computer and the versions of the packages that affect the figures."""
    packages = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    return (
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()}; "
        f"Python {platform.python_version()}, {packages}."
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """The processor's name; Linux gives it only in a file."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()
