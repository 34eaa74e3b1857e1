"""Campaigns: missions a second, cost of the engine, missions lost by kills, error rate."""

from __future__ import annotations

import os
import random
import resource
import signal
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely

from grebe.campaigns.certificate import Claim, SequentialTest, Verdict, log_evidence
from grebe.campaigns.engine import Processes, Serial
from grebe.campaigns.results import Results
from grebe.campaigns.run import run_campaign
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.campaigns.task import Scene, Summary
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region

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


def speeds(few: int = 4, many: int = 24) -> None:
    """Seconds of CPU a mission; and those of two workers over those of one process.

    A worker needs the same time to begin, however many missions it sails; it is listed separately.
    """
    print("| pond | sets | boat's s | CPU s a mission | with 2 workers | to begin | efficiency |")
    for name, corners, cell_m in (("400 m2", SMALL, 10.0), ("1750 m2", POND, 10.0)):
        survey = survey_of(corners, cell_m)
        spreads = {key: spread_of(key, value) for key, value in WEATHER.items()}
        success, claim = Success(within_s=240.0), Claim()
        campaign = Campaign(name=name, success=success, claim=claim, spreads=spreads)
        scene = Scene(campaign=campaign, survey=survey)
        scene(0)  # loads what is compiled
        before = time.process_time()
        serial = dict(Serial().results(scene, range(many)))
        alone = (time.process_time() - before) / many
        begins = _cpu_of_two(scene, {i: serial[i] for i in range(few)})
        both = (_cpu_of_two(scene, serial) - begins) / (many - few)
        boat_s = np.mean([one.duration_s for one in serial.values()])
        print(
            f"| {name} | {len(survey.targets)} | {boat_s:.0f} | {alone:.2f} | {both:.2f} "
            f"| {begins - few * both:.1f} | {alone / both:.2f} |",
            flush=True,
        )


def _cpu_of_two(scene: Scene, same_as: dict[int, Summary]) -> float:
    """Seconds of CPU that two workers and their parent need for some missions."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = time.process_time()
    got = dict(Processes(workers=2).results(scene, range(len(same_as))))
    assert got == same_as
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    children = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return children + time.process_time() - own


def kills(missions: int = 60) -> None:
    """Kill a worker at random after every third mission: the results must be the same."""
    survey, chance, killed = survey_of(SMALL, 10.0), random.Random(1), list[int]()
    spreads = {key: spread_of(key, value) for key, value in WEATHER.items()}
    success, claim = Success(within_s=120.0), Claim()
    campaign = Campaign(
        name="kills", success=success, claim=claim, missions=missions, spreads=spreads
    )

    def kill(done: int, _: int) -> None:
        if done % 3 == 0 and len(killed) < TRIALS and (victims := _workers()):
            killed.append(chance.choice(victims))
            os.kill(killed[-1], signal.SIGKILL)

    with tempfile.TemporaryDirectory() as name:
        results = Results(Path(name), "kills")
        outcome = run_campaign(campaign, survey, results, Processes(workers=2), kill)
        kept = Results(Path(name), "kills").known
    scene = Scene(campaign=campaign, survey=survey)
    undisturbed = [scene(number) for number in range(missions)]
    same = sum(kept.get(one.number) == one for one in undisturbed)
    print(f"{len(killed)} workers killed; {same} of {missions} missions on the disk are the same")
    print(f"as undisturbed, the certificate too: {list(outcome.missions) == undisturbed}")


def _workers() -> list[int]:
    """The worker processes that this one has started."""
    pid = os.getpid()
    pids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(p) for p in pids if b"spawn_main" in Path(f"/proc/{p}/cmdline").read_bytes()]


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
        test.count(success=bool(chance.uniform() < truth))
    return test.missions
