"""A mission that is killed at random moments, and what must be true of its file then.

What had been written is known from outside: the boat is one of the user's own (`python:FILE`), and
its file hangs a witness on the recorder, which says in a second file what was kept, by a write
of its own after the transaction's end. `benchmarks/survival.py` kills a hundred times.
"""

from __future__ import annotations

import json
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

from grebe.io.store import SurveyFile
from grebe.mission.departure import prepare

# The boat: simulated, at a pace that leaves time to be killed in, and a witness of each write.
BOAT = """
import os, time
from grebe.io.store.timestamps import time_text
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.recorders import SurveyRecorder
from grebe.core.events import Reached, SampleTaken, Step
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

WITNESS = os.open({witness!r}, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
keep = SurveyRecorder.record_together

def record_together(self, events):
    more = keep(self, events)
    for event in events:
        if isinstance(event, SampleTaken):
            os.write(WITNESS, f"sample {{time_text(event.sample.time)}}\\n".encode())
        elif isinstance(event, Reached):
            os.write(WITNESS, f"reached {{event.target_seq}}\\n".encode())
        elif isinstance(event, Step):
            os.write(WITNESS, f"step {{time_text(event.time)}}\\n".encode())
    return more

if keep.__name__ != "witnessed":  # the file is run once to be checked, and once to be used
    record_together.__name__ = "witnessed"
    SurveyRecorder.record_together = record_together

class Boat(SimulatedLink):
    def observe(self):
        time.sleep({pace_s})
        return super().observe()

def boat_at(departure):
    plant = Plant(departure.vessel, departure.state)
    return Boat(plant, UniformSonde(values={{"ph": 7.0}}), source="killed")
"""
RUN = "from grebe.cli.main import main; main()"


class Victim:
    """A survey whose mission is killed, the boat that sails it, and the witness of its writes."""

    def __init__(self, path: Path, witness: Path, boats: int = 1) -> None:
        self.path, self.witness = path, witness
        self.boats = boats
        self.kills = 0

    @classmethod
    def of(cls, folder: Path, survey: Path, pace_s: float = 0.002, boats: int = 1) -> Victim:
        """A copy of a planned survey in a folder, with boats at a pace that can be killed."""
        victim = cls(folder / "s.gpkg", folder / "witness", boats)
        shutil.copy(survey, victim.path)
        victim.boat.write_text(BOAT.format(witness=str(victim.witness), pace_s=pace_s))
        return victim

    @property
    def boat(self) -> Path:
        return self.path.with_name("boat.py")

    def start(self, *more: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", RUN, "run", str(self.path),
             *self.boats * ("--link", f"python:{self.boat}"), "--json", *more],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def said(self, what: str) -> list[str]:
        """What was said to be written, of one kind."""
        if not self.witness.exists():
            return []
        lines = self.witness.read_text().splitlines()
        return [line.split()[1] for line in lines if line.startswith(what)]

    def wait_for(self, steps: int, running: subprocess.Popen[str]) -> None:
        """Until so many steps were said to be written, or the mission is over."""
        while len(self.said("step")) < steps and running.poll() is None:
            time.sleep(0.002)


def kill(victim: Victim, steps: int, delay_s: float, *more: str) -> None:
    """Run, and kill -9 so long after so many steps more than there are."""
    with victim.start(*more) as running:
        victim.wait_for(len(victim.said("step")) + steps, running)
        time.sleep(delay_s)
        running.send_signal(signal.SIGKILL)
        running.communicate()
    victim.kills += 1


def cut_power(victim: Victim, running: subprocess.Popen[str], folder: Path, junk: bytes) -> Victim:
    """The files of a running mission as they lie there at one moment, copied to another folder.

    `junk` stands for what was being written: nobody knows what a power cut leaves of that.
    """
    copy = Victim(folder / "s.gpkg", folder / "witness")
    running.send_signal(signal.SIGSTOP)
    for source, to in ((victim.path, copy.path), (victim.witness, copy.witness)):
        shutil.copy(source, to)
    journal = copy.path.with_name("s.gpkg-wal")
    shutil.copy(victim.path.with_name("s.gpkg-wal"), journal)
    running.send_signal(signal.SIGCONT)
    with journal.open("ab") as file:
        file.write(junk)
    copy.kills = victim.kills + 1
    return copy


def faults(victim: Victim) -> list[str]:
    """What is wrong with the file of a killed mission, by what was said to be in it."""
    rows = {}
    with closing(sqlite3.connect(victim.path)) as connection:
        sound = connection.execute("PRAGMA integrity_check").fetchone()[0]
        for table in ("samples", "track"):
            found = connection.execute(f"SELECT time FROM {table} ORDER BY fid").fetchall()
            rows[table] = [time for (time,) in found]
    with SurveyFile.open(victim.path) as file:
        counted, progress = sum(file.progress().sample_counts), file.progress()
        within = int((file.samples().target_seq > 0).sum())
        departure = prepare(file, file.track_ends()[1].time, resume=True)
        last = file.track()
    arrived = [seq for seq, when in enumerate(progress.reached_at, 1) if when]
    wrong = {f"integrity_check: {sound}": sound != "ok"}
    for table, word in (("samples", "sample"), ("track", "step")):
        said, kept = victim.said(word), rows[table]
        wrong[f"{table} lost: {set(said) - set(kept)}"] = not set(said) <= set(kept)
        wrong[f"{table}: {len(kept)} of {len(said)}"] = (
            not 0 <= len(kept) - len(said) <= 5 * victim.kills
        )
        wrong[f"{table} doubled"] = len(kept) != len(set(kept))
        wrong[f"{table} out of order"] = kept != sorted(kept)
    lost = set(map(int, victim.said("reached"))) - set(arrived)
    wrong[f"arrivals lost: {lost}"] = bool(lost)
    wrong[f"arrivals with gaps: {arrived}"] = arrived != list(range(1, len(arrived) + 1))
    wrong["the next set is another"] = departure.reached != len(arrived)
    wrong["the boat is expected elsewhere"] = departure.state != tuple(last.states[-1])
    wrong[f"{within} samples in sets, {counted} counted"] = within != counted
    return [what for what, is_so in wrong.items() if is_so]


def faults_at_the_end(victim: Victim) -> list[str]:
    """Go on to the end, and say what is wrong: all that was there must be there still, and once."""
    with SurveyFile.open(victim.path) as file:
        before, reached = file.samples().times, file.progress().reached_at
    with victim.start("--resume") as running:
        out, err = running.communicate(timeout=300)
    if running.returncode:
        return [f"resuming ended with {running.returncode}: {err}"]
    report = json.loads(out)
    with SurveyFile.open(victim.path) as file:
        after, now = file.samples().times, file.progress().reached_at
        starts = [event.message for event in file.events() if event.code == "mission_started"]
    count = sum(when is not None for when in reached)
    said = f"{count} reached before" in starts[-1]
    wrong = {
        "not complete": report["reached"] != report["targets"],
        "samples changed": list(after[: len(before)]) != list(before),
        "samples doubled after resuming": len(set(after)) != len(after),
        "arrivals changed": any(a not in (None, b) for a, b in zip(reached, now, strict=True)),
        f"it began elsewhere: {starts[-1]}, not at {count}": 0 < count < len(now) and not said,
    }
    return [what for what, is_so in wrong.items() if is_so]


def fleet_faults(victim: Victim) -> list[str]:
    """What is wrong with the file of a killed fleet, by what was said to be in it: several boats
    write at the same times of their own.
    """
    kept = {}
    with closing(sqlite3.connect(victim.path)) as connection:
        sound = connection.execute("PRAGMA integrity_check").fetchone()[0]
        for table in ("samples", "track"):
            kept[table] = connection.execute(f"SELECT time, boat FROM {table}").fetchall()
    with SurveyFile.open(victim.path) as file:
        arrived = {
            target.seq
            for target, when in zip(file.survey.targets, file.progress().reached_at, strict=True)
            if when
        }
    wrong = {f"integrity_check: {sound}": sound != "ok"}
    for table, word in (("samples", "sample"), ("track", "step")):
        said, times = Counter(victim.said(word)), Counter(time for time, _ in kept[table])
        wrong[f"{table} lost: {said - times}"] = bool(said - times)
        wrong[f"{table} doubled"] = len(kept[table]) != len(set(kept[table]))
    lost = set(map(int, victim.said("reached"))) - arrived
    wrong[f"arrivals lost: {lost}"] = bool(lost)
    return [what for what, is_so in wrong.items() if is_so]


def fleet_faults_at_the_end(victim: Victim) -> list[str]:
    """Go on to the end, and say what is wrong then."""
    with victim.start("--resume") as running:
        out, err = running.communicate(timeout=600)
    if running.returncode:
        return [f"resuming ended with {running.returncode}: {err}"]
    report = json.loads(out)
    complete = report["reached"] == report["targets"]
    return [*fleet_faults(victim), *([] if complete else [f"not complete: {report}"])]
