"""Whole commands as a user runs them, in CPU seconds of the process and its children; missions.

`python -m benchmarks commands missions_a_second first_run`.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import shapely

import grebe
from benchmarks.common import BOAT, START, print_head, print_row
from benchmarks.planning import FRAME, archipelago, lake
from benchmarks.rebuilt import RebuiltPilot
from grebe.control.controller import Controller
from grebe.control.rules.dual import Dual
from grebe.control.turn_and_go import model_substeps
from grebe.core.dynamics import Weather
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, meander, simulate

GREBE = (sys.executable, "-c", "from grebe.cli.main import main; main()")


@dataclass(frozen=True, kw_only=True)
class Errand:
    """A `grebe plan` as a user runs it: of which water, with which option, repeated how often."""

    water: Callable[[], shapely.Polygon]
    option: tuple[str, float]
    runs: int = 3


@dataclass(frozen=True, kw_only=True)
class Planned:
    """The time and the result of the quickest run of an errand.

    `gap` is the order's length over the bound, as a share; `used` the share of the given time that
    the plan uses.
    """

    cpu_s: float
    targets: int
    gap: float
    used: float | None

    def __str__(self) -> str:
        if self.used is None:
            return f"{self.gap:.4f} over the bound"
        return f"uses {self.used:.2f} of the time"


K1000, K100000 = "plan, 1,000 cells", "plan, 100,000 cells"
WIDE = "plan, 1,564 ha with 8 islands, cells of 50 m"
MINUTES = "plan --minutes 30"
# The first run may compile kernels, so each command runs more than once.
ERRANDS = {
    K1000: Errand(water=lambda: lake(1_000), option=("--cell", 5)),
    K100000: Errand(water=lambda: lake(100_000), option=("--cell", 5), runs=2),
    WIDE: Errand(water=archipelago, option=("--cell", 50), runs=2),
    MINUTES: Errand(water=lambda: lake(1_000), option=("--minutes", 30)),
}


@cache
def planned(name: str) -> Planned:
    """Run one of the errands, at most once a run of the benchmarks."""
    errand = ERRANDS[name]
    option, value = errand.option
    with tempfile.TemporaryDirectory() as folder:
        outline = outlined(Path(folder), errand.water())
        runs = [
            told(GREBE, "plan", outline, option, value, "-o", Path(folder) / f"{k}.gpkg")
            for k in range(errand.runs)
        ]
    seconds, said = min(runs, key=lambda run: run[0])
    return Planned(
        cpu_s=seconds,
        targets=said["targets"],
        gap=said["gap"],
        used=said["time_s"] / (60 * value) if option == "--minutes" else None,
    )


def outlined(folder: Path, water: shapely.Polygon) -> Path:
    """Write a water's outline as GeoJSON to a folder."""
    path = folder / "water.geojson"
    outline = shapely.transform(water, FRAME.to_wgs84)
    feature = {
        "type": "Feature",
        "properties": {},
        "geometry": json.loads(shapely.to_geojson(outline)),
    }
    path.write_text(json.dumps(feature))
    return path


def told(
    program: tuple[str, ...], *words: object, environment: Mapping[str, str] | None = None
) -> tuple[float, dict]:
    """CPU seconds of a command with its children, and the JSON that it printed.

    Raises `RuntimeError` with its last output if it fails.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [*program, *map(str, words), "--json"],
        check=False, capture_output=True, text=True, env=environment,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:]
        raise RuntimeError(f"grebe {words[0]} ended with {done.returncode}: {' '.join(last)}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, json.loads(done.stdout)


def commands() -> None:
    """CPU seconds of whole commands, the best of some runs."""
    print_head("Whole commands", "command", "targets", "CPU s", "result")
    for name in ERRANDS:
        one = planned(name)
        print_row(name, one.targets, f"{one.cpu_s:.1f}", one)


CALM, MOVING = "calm", "0.28 m/s unknown, noise"
WEATHERS = {
    CALM: Conditions(),
    MOVING: Conditions(
        weather=Weather(current_north_mps=0.2, current_east_mps=-0.2),
        errors=EstimateErrors(velocity_mps=0.02),
    ),
}


@dataclass(frozen=True, kw_only=True)
class Pace:
    """How quickly missions are sailed: the boat's time for one, and missions a second and core."""

    boat_s: float
    a_second: float


def pace(weather: str, missions: int = 5) -> Pace:
    """Sail missions of 40 cells on one core, with the whole loop and without a file."""
    cells, conditions = meander(rows=4), WEATHERS[weather]
    simulate(BOAT, cells[:4], Controller(BOAT, cells[:4]), START, conditions)
    began = time.process_time()
    flights = [
        simulate(BOAT, cells, Controller(BOAT, cells), START, conditions) for _ in range(missions)
    ]
    seconds = (time.process_time() - began) / missions
    return Pace(boat_s=flights[0].duration_s, a_second=1 / seconds)


@cache
def baseline_s() -> float:
    """CPU seconds of the baseline's control steps in a calm mission of the same cells.

    They make missions a second comparable between computers.
    """
    cells, rule = meander(rows=4), Dual()
    pilot = RebuiltPilot(BOAT, cells, rule, model_substeps(BOAT, rule.step_s))
    return sum(simulate(BOAT, cells, pilot, START).step_ms) / 1000


def missions_a_second() -> None:
    print_head(
        "Missions a second and core, 40 cells, no file",
        "weather", "boat's s", "missions / s", "in the time of the baseline's steps",
    )  # fmt: skip
    for weather in WEATHERS:
        one = pace(weather)
        print_row(
            weather, f"{one.boat_s:.0f}", f"{one.a_second:.2f}",
            f"{one.a_second * baseline_s():.1f}",
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FirstRun:
    """CPU seconds of the first `grebe run` after installation, in all its processes, and of the
    next; and the first one's elapsed time, on a computer that may have other work.
    """

    first_s: float
    next_s: float
    clock_s: float

    def __str__(self) -> str:
        return (
            f"{self.first_s:.1f} s of CPU, {self.clock_s:.1f} s by the clock; "
            f"the next one {self.next_s:.1f} s of CPU"
        )


def of_a_new_copy() -> FirstRun:
    """Run the same small mission twice by a copy of the package without machine code."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(
            Path(grebe.__file__).parent, folder / "grebe",
            ignore=shutil.ignore_patterns("__pycache__"),
        )  # fmt: skip
        environment = os.environ | {"PYTHONPATH": name, "PYTHONDONTWRITEBYTECODE": ""}
        environment.pop("NUMBA_CACHE_DIR", None)
        survey = folder / "survey.gpkg"
        told(GREBE, "plan", outlined(folder, lake(20)), "--cell", 5, "-o", survey)
        used, clock = [], []
        for k in range(2):
            copied = shutil.copy(survey, folder / f"{k}.gpkg")
            began = time.perf_counter()
            used.append(told(GREBE, "run", copied, environment=environment)[0])
            clock.append(time.perf_counter() - began)
    return FirstRun(first_s=used[0], next_s=used[1], clock_s=clock[0])


def first_run() -> None:
    """What is compiled before the first mission, once."""
    print(f"\nThe first `grebe run` after installation: {of_a_new_copy()}.")
