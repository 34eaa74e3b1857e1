"""Whole commands as a user gives them, CPU seconds of the process and its children; and missions.

`python -m benchmarks commands missions_a_second`.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import shapely

from benchmarks.common import BOAT, START, print_head, print_row
from benchmarks.planning import FRAME, lake
from benchmarks.sorties import archipelago
from grebe.control.controller import Controller
from grebe.core.dynamics import Weather
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, fly, meander
from grebe.workflow.kernel_cache import COMPILE

GREBE = (sys.executable, "-c", "from grebe.cli.main import main; main()")


def _outline(folder: Path, name: str, water: shapely.Polygon) -> Path:
    path = folder / f"{name}.geojson"
    outline = shapely.transform(water, FRAME.to_wgs84)
    feature = {
        "type": "Feature",
        "properties": {},
        "geometry": json.loads(shapely.to_geojson(outline)),
    }
    path.write_text(json.dumps(feature))
    return path


def _run(*words: object) -> tuple[float, dict]:
    """CPU seconds of a command, its children with it, and what it printed as JSON."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*GREBE, *map(str, words), "--json"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, json.loads(done.stdout)


def commands() -> None:
    """CPU seconds of whole commands, the best of three (the large ones once)."""
    print_head("Whole commands", "command", "targets", "CPU s", "told")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        small, large = (_outline(folder, f"k{k}", lake(k)) for k in (1000, 100_000))
        wide = _outline(folder, "wide", archipelago())
        for what, times, *words in (
            ("plan, 1,000 cells", 3, small, "--cell", 5),
            ("plan, 100,000 cells", 1, large, "--cell", 5),
            ("plan, 1,564 ha with 8 islands, cells of 50 m", 1, wide, "--cell", 50),
            ("plan --minutes 30", 3, small, "--minutes", 30),
        ):
            runs = []
            for k in range(times):
                out = folder / f"{len(list(folder.iterdir()))}_{k}.gpkg"
                runs.append(_run("plan", *words, "-o", out))
            seconds, told = min(runs, key=lambda run: run[0])
            share = told["time_s"] / 1800 if "--minutes" in words else None
            said = f"uses {share:.2f} of the time" if share else f"gap {told['gap']:.4f}"
            print_row(what, told["targets"], f"{seconds:.1f}", said)


def missions_a_second(missions: int = 5) -> None:
    """Missions of 40 cells, the whole loop and no file, by one core."""
    cells = meander(rows=4)
    print_head(
        "Missions a second and core, 40 cells, no file", "weather", "boat's s", "missions / s"
    )
    current = Weather(current_north_mps=0.2, current_east_mps=-0.2)
    for name, conditions in (
        ("calm", Conditions()),
        (
            "0.28 m/s unknown, noise",
            Conditions(weather=current, errors=EstimateErrors(velocity_mps=0.02)),
        ),
    ):
        fly(BOAT, cells[:4], Controller(BOAT, cells[:4]), START, conditions)
        began = time.process_time()
        flights = [
            fly(BOAT, cells, Controller(BOAT, cells), START, conditions) for _ in range(missions)
        ]
        seconds = (time.process_time() - began) / missions
        print_row(name, f"{flights[0].duration_s:.0f}", f"{1 / seconds:.2f}")


def first_run() -> None:
    """Seconds of the compilation before the first mission, into an empty folder."""
    with tempfile.TemporaryDirectory() as name:
        environment = os.environ | {"NUMBA_CACHE_DIR": name}
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, "-c", COMPILE], check=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = time.perf_counter() - began
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"\nMachine code for missions, compiled once: {used:.0f} s of CPU, {took:.0f} s in all.")
