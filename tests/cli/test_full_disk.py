"""On a full disk every command ends with one sentence, and earlier files stay intact."""

import json
import os
import resource
import subprocess
import sys
from datetime import timedelta

import pytest
from conftest import NOON, square_survey
from killing import Victim

from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag, Sample
from grebe.io.store import SurveyFile
from grebe.workflow.files import write_survey

GREBE = [sys.executable, "-c", "from grebe.cli.main import main; main()"]


def on_a_disk_of(room, *words, cwd):
    """Run a command with a limit of `room` bytes on the size of each file that it writes."""
    return subprocess.run(
        [*GREBE, *map(str, words)],
        cwd=cwd,
        # Python would also truncate its compiled modules, and fail on them from then on.
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A survey with samples, and older files under the names that the commands write."""
    folder = tmp_path_factory.mktemp("full")
    path = folder / "s.gpkg"
    write_survey(path, square_survey(side_m=30.0))
    with SurveyFile.open(path) as file:
        file.append_samples([sample(i) for i in range(200)])
    write_survey(folder / "big.gpkg", square_survey(side_m=200.0, cell_m=10.0))
    rows = [f"{i},{50.636 + 1e-5 * (i % 30)},{3.171 + 1e-5 * (i // 30)},7" for i in range(3000)]
    (folder / "t.csv").write_text("\n".join(["time,lat,lon,ph", *rows]))
    (folder / "maps").mkdir()
    for name in ("s.plan", "r.html", "maps/map.nc", "t.gpkg"):
        (folder / name).write_text("older")
    return folder


def sample(i):
    values = dict.fromkeys(LIMNOLOGICAL, 5.0 + 0.01 * (i % 17))
    return Sample(
        time=NOON + timedelta(seconds=i),
        north_m=2.0 * (i % 15),
        east_m=2.0 * (i // 15),
        target_seq=None,
        speed_mps=1.0,
        values=values,
        flags=dict.fromkeys(values, Flag.GOOD),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "keeps", "room"),
    [
        (["export", "s.gpkg", "-o", "s.plan", "--force"], "s.plan", 1000),
        (["export", "big.gpkg", "-o", "s.plan", "--force"], "s.plan", 33_000),
        (["report", "s.gpkg", "-o", "r.html", "--force"], "r.html", 60_000),
        (["map", "s.gpkg", "--out", "maps", "--force"], "maps/map.nc", 60_000),
        (["import", "t.csv", "-o", "t.gpkg", "--force"], "t.gpkg", 120_000),
    ],
    ids=str,
)
def test_a_command_that_finds_the_disk_full_leaves_the_older_file(folder, words, keeps, room):
    done = on_a_disk_of(room, *words, cwd=folder)
    assert done.returncode == 3
    (sentence,) = [line for line in done.stderr.splitlines() if line.startswith("grebe: ")]
    assert "Traceback" not in done.stderr
    assert "damaged" not in sentence
    assert "cannot be" in sentence
    assert (folder / keeps).read_text() == "older"
    assert [path.name for path in folder.rglob("*part*")] == []


@pytest.mark.slow
def test_a_mission_whose_disk_fills_up_stops_the_boat_and_keeps_its_record(tmp_path):
    planned = tmp_path / "planned.gpkg"
    write_survey(planned, square_survey(side_m=40.0))
    victim = Victim.of(tmp_path, planned, pace_s=0.0)
    stops = "\n\ndef close(self):\n    os.write(WITNESS, b'stopped it\\n')\n\nBoat.close = close\n"
    victim.boat.write_text(victim.boat.read_text() + stops)
    done = on_a_disk_of(
        400_000, "run", victim.path, "--link", f"python:{victim.boat}", cwd=tmp_path
    )
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    assert done.stderr.count("what was recorded before is kept") == 1
    assert victim.said("stopped")
    with SurveyFile.open(victim.path) as file:
        kept, steps = len(file.samples()), len(file.track())
    assert (kept, steps) == (len(victim.said("sample")), len(victim.said("step")))
    assert steps > 10
    with victim.start("--resume") as running:
        out, _ = running.communicate()
    report = json.loads(out)
    assert report["reached"] == report["targets"]
