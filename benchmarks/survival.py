"""A hundred kills -9 and power cuts at random times, and twenty of a fleet; the harness is
`tests/killing.py`.
"""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.common import print_head, print_row

TESTS = Path(__file__).resolve().parents[1] / "tests"
# Kills of one mission before it is resumed to its end.
IN_A_ROW = 5
BOATS = 3


def survival(kills: int = 100, seed: int = 1) -> None:
    sys.path.insert(0, str(TESTS))
    from conftest import square_survey
    from killing import Victim, cut_power, faults, faults_at_the_end, kill

    from grebe.workflow.files import write_survey

    rng = random.Random(seed)
    wrong: dict[str, list[str]] = {"kill -9": [], "power cut": [], "resumed": []}
    with tempfile.TemporaryDirectory(prefix="bench-", dir=Path.cwd()) as name:
        planned = Path(name) / "planned.gpkg"
        write_survey(planned, square_survey(side_m=70.0))
        for _ in range(kills // IN_A_ROW):
            here, there = Path(name) / "here", Path(name) / "there"
            here.mkdir()
            victim = Victim.of(here, planned)
            for again in range(IN_A_ROW):
                more = ["--resume"] if again else []
                kill(victim, rng.randrange(1, 30), rng.uniform(0, 0.2), *more)
                wrong["kill -9"] += faults(victim)
            with victim.start("--resume") as running:
                victim.wait_for(len(victim.said("step")) + rng.randrange(1, 10), running)
                there.mkdir()
                copy = cut_power(victim, running, there, rng.randbytes(rng.randrange(6000)))
                running.kill()
                running.communicate()
            victim.kills += 1
            wrong["power cut"] += faults(copy)
            wrong["resumed"] += faults(victim) + faults_at_the_end(victim)
            shutil.rmtree(here)
            shutil.rmtree(there)
    print_head("A mission is cut off at random times", "how", "times", "faults")
    times = {"kill -9": kills, "power cut": kills // IN_A_ROW, "resumed": kills // IN_A_ROW}
    for how, found in wrong.items():
        print_row(how, times[how], len(found))
        for fault in found:
            print(f"  {fault}")


def fleet_survival(kills: int = 20, seed: int = 2) -> None:
    """Three boats in one process, which is killed five times on the way before it goes on to the
    end.
    """
    sys.path.insert(0, str(TESTS))
    from killing import Victim, fleet_faults, fleet_faults_at_the_end, kill
    from mission.test_traffic import fleet_file

    rng = random.Random(seed)
    killed: list[str] = []
    resumed: list[str] = []
    with tempfile.TemporaryDirectory(prefix="bench-", dir=Path.cwd()) as name:
        planned = fleet_file(Path(name) / "planned.gpkg", boats=BOATS, side=90.0)
        for _ in range(kills // IN_A_ROW):
            here = Path(name) / "here"
            here.mkdir()
            victim = Victim.of(here, planned, boats=BOATS)
            for again in range(IN_A_ROW):
                more = ["--resume"] if again else []
                kill(victim, rng.randrange(1, 60), rng.uniform(0, 0.2), *more)
                killed += fleet_faults(victim)
            resumed += fleet_faults_at_the_end(victim)
            shutil.rmtree(here)
    print_head(f"A fleet of {BOATS} is cut off at random times", "how", "times", "faults")
    print_row("kill -9", kills, len(killed))
    print_row("resumed to the end", kills // IN_A_ROW, len(resumed))
    for fault in (*killed, *resumed):
        print(f"  {fault}")
