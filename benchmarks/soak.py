"""Eight hours at 10 Hz with other readers of the file: memory, write times, file size.

Also the loop's part of a command's latency: from an estimate that is ready to be read to the
command that answers it, by the wall clock, with the survey file written as in a real mission.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common import BOAT, CELLS, START, print_head, print_row, told
from grebe.control.controller import Command, Controller
from grebe.core.errors import LinkError
from grebe.core.frames import LocalFrame
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.sets import rectangle
from grebe.core.survey import Pose, Survey, Target
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import BoatStatus, Observation, Order
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.recorders import SurveyRecorder
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings
from grebe.mission.trial import bare_survey
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde
from grebe.workflow.garbage_collection import no_long_pauses

PERIOD_S = 0.1
EIGHT_HOURS = 288_000
READING = dict.fromkeys(LIMNOLOGICAL, 10.0)
# Another program that reads the file now and then, as QGIS does: it keeps its connection, reads a
# complete layer, and holds a read transaction for a second each time.
READER = """
import sqlite3, sys, time
connection = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True, isolation_level=None)
while True:
    connection.execute("BEGIN")
    connection.execute("SELECT count(*), max(time) FROM samples").fetchall()
    list(connection.execute("SELECT geom, ph FROM samples ORDER BY fid DESC LIMIT 5000"))
    time.sleep(1.0)
    connection.execute("COMMIT")
    time.sleep(0.2)
"""


class Circling:
    """A boat that sails a circle without a plant, as fast as it is called, and records times."""

    source = "circling"

    def __init__(self, estimates: int, every: int, look: Any) -> None:
        self.left, self.every, self.look = estimates, every, look
        self.count = 0
        self.write_ms: list[float] = []
        self._commanded: float | None = None

    def observe(self) -> Observation:
        if self._commanded is not None:
            self.write_ms.append(1e3 * (time.perf_counter() - self._commanded))
            self._commanded = None
        if self.count == self.left:
            raise LinkError("that was all")
        if self.count and self.count % self.every == 0:
            self.look(self)
            self.write_ms.clear()
        angle = 0.01 * self.count
        state = (100 * math.cos(angle), 100 * math.sin(angle), angle, 1.5, 0.0, 0.1)
        self.count += 1
        return Observation(time_s=PERIOD_S * self.count, state=state)

    def command(self, order: Order) -> None:
        self._commanded = time.perf_counter()

    def measure(self) -> dict[str, float]:
        return READING

    def status(self) -> BoatStatus:
        return BoatStatus(mode="circling", armed=True)

    def stop(self) -> None:
        pass

    def close(self) -> None:
        pass


class Restless:
    """A helm that is called at every estimate, and commands something else each time."""

    vessel = PRESETS["spyboat"]
    step_s = PERIOD_S
    reached = 0

    def __init__(self) -> None:
        self._n = 0

    def step(self, state: Any, weather: Any, elapsed_s: float | None) -> Command:
        self._n += 1
        return told((float(self._n % 7), 1.0), 0)


def far_survey() -> Survey:
    """One target a hundred kilometres away, so that the mission lasts."""
    far = rectangle((1e5, 1e5 + 10), (0, 10), (1.0, 2.0))
    survey = bare_survey([far], PRESETS["spyboat"])
    return Survey(
        name="far",
        frame=LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0),
        water=survey.water,
        targets=(Target(seq=1, kind="cell", set=far, cell=far.polygon),),
        vessel=survey.vessel,
        start=Pose(north_m=0.0, east_m=0.0),
    )


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def wal_mb(path: Path) -> float:
    with suppress(OSError):
        return path.with_name(path.name + "-wal").stat().st_size / 1e6
    return 0.0


def soak(estimates: int = EIGHT_HOURS) -> None:
    print_head(
        "Eight hours at 10 Hz, two readers beside",
        "hours", "resident MB", "write ms, median / p99 / max", "journal MB", "file MB",
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="bench-", dir=Path.cwd()) as folder:
        path = Path(folder) / "soak.gpkg"
        SurveyFile.create(path, far_survey(), meta={}, force=False).close()
        readers = [subprocess.Popen([sys.executable, "-c", READER, str(path)]) for _ in range(2)]

        def look(link: Circling) -> None:
            ms = np.array(link.write_ms)
            print_row(
                f"{link.count * PERIOD_S / 3600:.1f}",
                f"{resident_mb():.1f}",
                " / ".join(f"{x:.2f}" for x in (np.median(ms), np.percentile(ms, 99), ms.max())),
                f"{wal_mb(path):.1f}",
                f"{path.stat().st_size / 1e6:.1f}",
            )

        with SurveyFile.open(path) as file:
            link = Circling(estimates, estimates // 8, look)
            settings = MissionSettings(observes=False)
            Mission(file.survey, Restless(), link, SurveyRecorder(file), settings).run()
            look(link)
            began = time.perf_counter()
        closing = time.perf_counter() - began
        for reader in readers:
            reader.kill()
            reader.wait()
        print(f"\nClosing took {closing:.2f} s.")
        for words in (["show"], ["run", "--resume", "--preview"]):
            began = time.perf_counter()
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks.cli", *words, str(path)],
                capture_output=True,
                text=True,
                check=False,
            )
            took = time.perf_counter() - began
            print(f"grebe {' '.join(words)}: {took:.2f} s, exit {done.returncode}")


class OnTheClock(SimulatedLink):
    """The simulated boat at 10 Hz of the wall clock: an estimate waits if the loop is late."""

    def __init__(self, plant: Plant, limit_s: float) -> None:
        super().__init__(plant, UniformSonde(values=READING))
        self.limit_s = limit_s
        self.latency_ms: list[float] = []
        self._t0 = self._due = time.perf_counter()
        self._answered = True

    def observe(self) -> Observation:
        seen = super().observe()
        if seen.time_s > self.limit_s:
            raise LinkError("that was all")
        self._due = self._t0 + seen.time_s
        time.sleep(max(0.0, self._due - time.perf_counter()))
        self._answered = False
        return seen

    def command(self, order: Order) -> None:
        if not self._answered:
            self.latency_ms.append(1e3 * (time.perf_counter() - self._due))
        self._answered = True
        super().command(order)


class SlowDisk(SurveyRecorder):
    """A slow card: a fixed time for each transaction [s]."""

    seconds = 0.0

    def record_together(self, events: Any) -> Any:
        kept = super().record_together(events)
        if any(type(event).__name__ in {"Step", "SampleTaken"} for event in events):
            time.sleep(self.seconds)
        return kept


def latency(minutes: float = 1.5) -> None:
    print_head(
        "An estimate in to a command out, `lookahead`, on the clock",
        "disk", "beside", "commands", "median / p99 / max ms",
    )  # fmt: skip
    for seconds, busy in ((0.0, 0), (0.0, 2), (0.05, 0), (0.15, 0)):
        others = [
            subprocess.Popen([sys.executable, "-c", "while True: sum(range(10000))"])
            for _ in range(busy)
        ]
        with tempfile.TemporaryDirectory(prefix="bench-", dir=Path.cwd()) as folder:
            ms = np.array(_flight(Path(folder) / "s.gpkg", seconds, 60 * minutes))
        for other in others:
            other.kill()
            other.wait()
        print_row(
            "as it is" if not seconds else f"{1e3 * seconds:.0f} ms more a transaction",
            f"{busy} busy processes" if busy else "idle",
            len(ms),
            " / ".join(f"{x:.1f}" for x in (np.median(ms), np.percentile(ms, 99), ms.max())),
        )


def _flight(path: Path, seconds: float, limit_s: float) -> list[float]:
    survey = bare_survey(CELLS, BOAT)
    SurveyFile.create(path, survey, meta={}, force=False).close()
    helm = Controller(BOAT, CELLS)
    helm.step(START)
    helm = Controller(BOAT, CELLS)
    with SurveyFile.open(path) as file:
        recorder = SlowDisk(file)
        recorder.seconds = seconds
        link = OnTheClock(Plant(BOAT, START), limit_s)
        with no_long_pauses():
            Mission(survey, helm, link, recorder).run()
        return link.latency_ms
