"""A hundred kills -9 and power cuts at random moments; the harness is `tests/killing.py`."""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.common import print_head, print_row

TESTS = Path(__file__).resolve().parents[1] / "tests"
# Kills of one mission before it is gone on with to its end.
IN_A_ROW = 5


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
    print_head("A mission is cut off at random moments", "how", "times", "faults")
    times = {"kill -9": kills, "power cut": kills // IN_A_ROW, "resumed": kills // IN_A_ROW}
    for how, found in wrong.items():
        print_row(how, times[how], len(found))
        for fault in found:
            print(f"  {fault}")
