"""Whole `grebe map` and `grebe report` as a user runs them: seconds of CPU, of all processes, and
elapsed.

`python -m benchmarks maps`.
"""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from benchmarks.commands import GREBE, outlined, told
from benchmarks.common import print_head, print_row

# In cells of 8 m a boat takes some 2,500 samples on 4 ha, which have 40,000 nodes a metre apart.
CELL_M, RESOLUTION_M, RUNS = 8, 1, 3


@dataclass(frozen=True, kw_only=True)
class Made:
    """The CPU and elapsed time of the quickest run of a command, and the number of its maps."""

    cpu_s: float
    clock_s: float
    maps: int


def bay() -> shapely.Polygon:
    """Water of 4 ha with a wavy shore."""
    turn = np.linspace(0, 2 * math.pi, 80, endpoint=False)
    radius = 113 + 8 * np.sin(3 * turn) + 5 * np.cos(5 * turn)
    return shapely.Polygon(np.column_stack([radius * np.sin(turn), radius * np.cos(turn)]))


def made(*words: object) -> Made:
    """Run a command several times and keep the quickest."""
    runs: list[Made] = []
    for _ in range(RUNS):
        began = time.perf_counter()
        used, said = told(GREBE, *words, "--force")
        maps = said["maps"]
        count = maps if isinstance(maps, int) else len(maps)
        runs.append(Made(cpu_s=used, clock_s=time.perf_counter() - began, maps=count))
    return min(runs, key=lambda run: run.cpu_s)


def maps() -> None:
    """A simulated survey, mapped by one process and by two, and its report."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        survey, out = folder / "survey.gpkg", ("--out", folder / "maps")
        water = outlined(folder, bay())
        told(GREBE, "plan", water, "--cell", CELL_M, "--vessel", "blueboat", "--speed", "0.5:1.5",
             "-o", survey)  # fmt: skip
        samples = told(GREBE, "run", survey)[1]["samples"]
        fine = ("--resolution", RESOLUTION_M)
        print_head(
            f"Whole commands, {samples:,} samples, {water_nodes(bay()):,} nodes",
            "command", "maps", "CPU s", "clock s",
        )  # fmt: skip
        for what, words in (
            ("`grebe map`, one process", ("map", survey, *out, *fine, "--workers", 1)),
            ("`grebe map`, two", ("map", survey, *out, *fine, "--workers", 2)),
            ("`grebe report`", ("report", survey, "-o", folder / "page.html", *fine)),
        ):
            one = made(*words)
            print_row(what, one.maps, f"{one.cpu_s:.1f}", f"{one.clock_s:.1f}")


def water_nodes(water: shapely.Polygon) -> int:
    """The approximate number of the map's nodes in the water."""
    return round(water.area / RESOLUTION_M**2)
