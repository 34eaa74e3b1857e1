"""Campaigns: missions a second, what the engine costs, what kills lose, how often it errs."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely

from grebe.campaigns.certificate import Claim, SequentialTest, Verdict, log_evidence
from grebe.campaigns.engine import Processes, Serial
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.campaigns.task import Scene
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region
from grebe.workflow.files import write_survey

FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.6)
POND = [(0, 0), (28, 0), (28, 21), (55, 21), (55, 42), (0, 42)]
SMALL = [(0, 0), (20, 0), (20, 20), (0, 20)]
WEATHER = {
    "current_mps": [0.0, 0.2],
    "wind_n": [0.0, 5.0],
    "mismatch": 0.1,
    "velocity_noise_mps": 0.02,
}
TRIALS = 20


def campaigns() -> None:
    """Print all tables."""
    speeds()
    kills()
    coverage()


def survey_of(corners: list[tuple[float, float]], cell_m: float) -> Survey:
    region = Region(name="pond", frame=FRAME, water=shapely.Polygon(corners))
    settings = PlanSettings(cell_m=cell_m, core=0.5, speed_min_mps=0.5, speed_max_mps=1.5)
    return plan_survey(region, PRESETS["spyboat"], settings)


def speeds(missions: int = 8) -> None:
    """Seconds of CPU a mission; and what two workers need over what one process needs."""
    print("| pond | sets | boat's s | CPU s a mission | with 2 workers | CPU efficiency |")
    for name, corners, cell_m in (("400 m2", SMALL, 10.0), ("1750 m2", POND, 10.0)):
        survey = survey_of(corners, cell_m)
        spreads = {key: spread_of(key, value) for key, value in WEATHER.items()}
        success, claim = Success(within_s=240.0), Claim()
        campaign = Campaign(name=name, success=success, claim=claim, spreads=spreads)
        scene = Scene(campaign=campaign, survey=survey)
        scene(0)  # loads what is compiled
        before = time.process_time()
        serial = dict(Serial().results(scene, range(missions)))
        alone = time.process_time() - before
        # What two workers need to begin is measured by themselves, on as good as nothing.
        idle = _cpu_of_children(abs)
        both = _cpu_of_children(scene, missions, serial) - idle
        boat_s = np.mean([one.duration_s for one in serial.values()])
        print(
            f"| {name} | {len(survey.targets)} | {boat_s:.0f} | {alone / missions:.2f} "
            f"| {both / missions:.2f} (+ {idle:.1f} to begin) | {alone / both:.2f} |"
        )


def _cpu_of_children(task, missions: int = 2, same_as=None) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = time.process_time()
    got = dict(Processes(workers=2).results(task, range(missions)))
    assert same_as is None or got == same_as
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    children = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return children + time.process_time() - own


FILE = """survey = "survey.gpkg"
missions = 6
[success]
within_minutes = 2
[claim]
confidence = 0.9
[draw]
current_mps = [0.0, 0.2]
wind_n = [0.0, 5.0]
mismatch = 0.1
velocity_noise_mps = 0.02
"""


def kills() -> None:
    """Kill a worker, or the whole command, at random: the certificate must be the same."""
    with tempfile.TemporaryDirectory() as name:
        folder, chance = Path(name), random.Random(1)
        write_survey(folder / "survey.gpkg", survey_of(SMALL, 10.0))
        (folder / "c.toml").write_text(FILE)
        began = time.monotonic()
        wanted = _certificate(_command(folder, "undisturbed"))
        takes = time.monotonic() - began
        same, hit = 0, 0
        for trial in range(TRIALS):
            process = _command(folder, f"trial{trial}")
            time.sleep(chance.uniform(0.1, 0.9) * takes)
            victims = _workers(process.pid) if trial % 2 else [process.pid]
            if victims and process.poll() is None:
                os.kill(chance.choice(victims), signal.SIGKILL)
                hit += 1
            process.communicate()
            # A command whose worker died goes on by itself; one that was killed is called again.
            same += _certificate(_command(folder, f"trial{trial}")) == wanted
        print(f"killed in {hit} of {TRIALS} trials, by turns the command and one of its workers:")
        print(f"the same {wanted['missions']} missions and certificate in {same} of {TRIALS}")


def _command(folder: Path, out: str) -> subprocess.Popen[str]:
    words = ["campaign", "c.toml", "--out", out, "--workers", "2", "--json"]
    program = "from grebe.cli.main import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", program, *words], cwd=folder, stdout=subprocess.PIPE, text=True
    )


def _certificate(process: subprocess.Popen[str]) -> dict:
    told = json.loads(process.communicate()[0])
    told.pop("files")
    return told


def _workers(pid: int) -> list[int]:
    """The processes that a command has started to work for it."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    pids = [int(word) for word in children.read_text().split()] if children.exists() else []
    return [p for p in pids if b"spawn_main" in Path(f"/proc/{p}/cmdline").read_bytes()]


def coverage(missions: int = 1000, alpha: float = 0.01) -> None:
    """Exact probabilities that a false claim is ever certified, and how soon a true one is."""
    print(f"exactly, looked at after each of {missions} missions, alpha {alpha:g}:")
    for share in (0.9, 0.95, 0.99):
        alive, wrong = np.array([1.0]), 0.0
        for n in range(1, missions + 1):
            alive = np.append(alive * (1 - share), 0.0) + np.insert(alive * share, 0, 0.0)
            for s in range(n, -1, -1):  # evidence falls with s: those that cross are at the end
                if log_evidence(s, n - s, share) < -np.log(alpha):
                    break
                wrong += alive[s]
                alive[s] = 0.0
        print(f"| share {share} | certified though only just true: {wrong:.4f} |")
    chance = np.random.default_rng(1)
    for share, truth in ((0.9, 1.0), (0.9, 0.98), (0.95, 1.0), (0.95, 0.99), (0.99, 1.0)):
        took = [_stops(share, truth, chance, alpha) for _ in range(200)]
        print(f"| claim {share} | truth {truth} | median {np.median(took):.0f} missions |")


def _stops(share: float, truth: float, chance: np.random.Generator, alpha: float) -> int:
    test = SequentialTest(Claim(confidence=1 - alpha, share=share))
    while test.missions < 5000 and test.verdict is Verdict.OPEN:
        test.hear(success=bool(chance.uniform() < truth))
    return test.missions
