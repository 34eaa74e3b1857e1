"""The command line as a user calls it: results, exit codes, one sentence for bad input."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import CHINA, needs_tracks

from grebe.cli.main import COMMANDS

GREBE = [sys.executable, "-c", "from grebe.cli.main import main; main()"]
SQUARE = [[3.171, 50.636], [3.1714, 50.636], [3.1714, 50.63625], [3.171, 50.63625], [3.171, 50.636]]


def grebe(*words, cwd, check=None):
    done = subprocess.run(
        [*GREBE, *map(str, words)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    if check is not None:
        assert done.returncode == check, done.stderr
    return done


def lake(folder, coordinates=None):
    path = folder / "lake.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [coordinates or SQUARE]}))
    return path


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    lake(folder)
    plan = ["plan", "lake.geojson", "-o", "s.gpkg", "--cell", 7, "--start", "3.1709,50.636"]
    grebe(*plan, cwd=folder, check=0)
    run = grebe("run", "s.gpkg", "--json", "--seed", 3, cwd=folder, check=0)
    return folder, json.loads(run.stdout)


def test_a_lake_is_planned_sailed_mapped_and_reported(sailed):
    folder, report = sailed
    assert report["reached"] == report["targets"] > 10
    assert report["unsolved_steps"] == 0
    keys = "reached targets steps duration_s path_m energy_wh unsolved_steps step_ms_median"
    assert set(f"{keys} step_ms_p95 samples samples_in_sets ended message".split()) == set(report)
    mapped = grebe("map", "s.gpkg", "--out", "maps", cwd=folder, check=0)
    assert "grebe report s.gpkg" in mapped.stdout
    pictures = {path.name for path in (folder / "maps").iterdir()}
    assert {"map.nc", "ph.png", "turbidity_ntu.png"} <= pictures
    grebe("report", "s.gpkg", "-o", "r.html", cwd=folder, check=0)
    page = (folder / "r.html").read_text()
    assert page.count("data:image/png;base64,") == 7
    assert "http" not in re.sub(r"data:image[^\"]*", "", page)
    shown = json.loads(grebe("show", "s.gpkg", "--json", cwd=folder, check=0).stdout)
    assert shown["samples"] == report["samples"]


def test_a_planned_survey_without_samples_is_no_crash(tmp_path):
    lake(tmp_path)
    grebe("plan", "lake.geojson", "-o", "s.gpkg", "--cell", 7, cwd=tmp_path, check=0)
    shown = grebe("show", "s.gpkg", cwd=tmp_path, check=0)
    assert "grebe run s.gpkg" in shown.stdout
    assert "not measured" in grebe("map", "s.gpkg", "--out", "m", cwd=tmp_path, check=3).stderr
    grebe("report", "s.gpkg", "-o", "r.html", cwd=tmp_path, check=0)


def test_running_again_needs_resume_or_force(sailed):
    folder, _ = sailed
    assert "resume it" in grebe("run", "s.gpkg", cwd=folder, check=3).stderr


def test_help_is_quick_because_it_imports_nothing_heavy():
    heavy = ["casadi", "numba", "matplotlib", "scipy", "shapely", "netCDF4", "gstools"]
    code = (
        "import sys; from grebe.cli.main import grebe\n"
        "try: grebe(['--help'])\n"
        f"except SystemExit: print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")
    for command in COMMANDS:
        assert command in done.stdout


def test_the_bare_command_says_what_to_type(tmp_path):
    done = grebe(cwd=tmp_path, check=0)
    assert len(done.stdout.splitlines()) == 6


BOWTIE = [[3.0, 50.0], [3.001, 50.001], [3.001, 50.0], [3.0, 50.001], [3.0, 50.0]]
TINY = [[3.171, 50.636], [3.17105, 50.636], [3.17105, 50.63603], [3.171, 50.63603], [3.171, 50.636]]


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["plan", "none.geojson", "-o", "x.gpkg"], 3, "no such file"),
        (["plan", "lake.geojson"], 2, "--output"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--vessel", "spybot"], 3, "'spyboat'"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--speed", "5:6"], 4, "full thrust"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--speed", "2:1"], 2, "give 0 <= lower end"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--speed", "fast"], 2, "LO:HI"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--start", "nan,50"], 2, "finite"),
        (["plan", "tiny.geojson", "-o", "x.gpkg"], 4, "less than one cell"),
        (["plan", "bowtie.geojson", "-o", "x.gpkg"], 3, "not a simple polygon"),
        (["plan", "lake.geojson", "-o", "taken.gpkg"], 3, "--force"),
        (["run", "none.gpkg"], 3, "no such survey file"),
        (["run", "lake.geojson"], 3, "not an SQLite"),
        (["run", "none.gpkg", "--link", "radio"], 5, "begins with one of sim:"),
        (["run", "none.gpkg", "--horizon", "1"], 2, "2 to 100"),
        (["plan", "lake.geojson", "-o", "lake.geojson", "--force"], 3, "being read"),
        (["plan", "lake.geojson", "-o", "no/x.gpkg"], 3, "no folder"),
        (["run", "none.gpkg", "--seed", "-1"], 2, "--seed"),
        (["run", "none.gpkg", "--resume", "--force"], 2, "one of them"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--cell", "0"], 2, "positive"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--minutes", "-5"], 2, "positive"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--range", "-5"], 2, "positive"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--core", "2"], 2, "share of the cell"),
        (["plan", "lake.geojson", "-o", "x.gpkg", "--start", "50,3"], 3, "km from the water"),
        (["show", "."], 3, "a folder"),
        (["demo", "--out", "taken.gpkg/x"], 3, "folder"),
        (["dance"], 2, "No such command"),
    ],
)
def test_bad_input_gets_one_sentence_and_the_right_code(tmp_path, words, code, says):
    lake(tmp_path)
    for name, ring in (("bowtie", BOWTIE), ("tiny", TINY)):
        text = json.dumps({"type": "Polygon", "coordinates": [ring]})
        (tmp_path / f"{name}.geojson").write_text(text)
    (tmp_path / "taken.gpkg").write_text("mine")
    done = grebe(*words, cwd=tmp_path, check=code)
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "x.gpkg").exists()
    assert (tmp_path / "taken.gpkg").read_text() == "mine"


@pytest.mark.parametrize(("sign", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 6)])
def test_a_stopped_run_keeps_its_data_and_can_be_resumed(tmp_path, sign, code):
    lake(tmp_path)
    grebe("plan", "lake.geojson", "-o", "s.gpkg", "--cell", 4, cwd=tmp_path, check=0)
    with subprocess.Popen(
        [*GREBE, "run", "s.gpkg"], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    ) as running:
        _wait_for_samples(tmp_path / "s.gpkg")
        running.send_signal(sign)
        _, complaint = running.communicate(timeout=60)
    assert running.returncode == code, complaint
    assert "kept" in complaint
    before = json.loads(grebe("show", "s.gpkg", "--json", cwd=tmp_path, check=0).stdout)
    assert before["samples"] > 0
    report = json.loads(grebe("run", "s.gpkg", "--resume", "--json", cwd=tmp_path, check=0).stdout)
    assert report["reached"] == report["targets"]


def _wait_for_samples(path: Path):
    """Wait until the running mission's write-ahead log is larger than opening the file makes it."""
    wal = path.with_name(path.name + "-wal")
    for _ in range(600):
        if wal.exists() and wal.stat().st_size > 200_000:
            return
        time.sleep(0.1)
    raise AssertionError("the mission wrote nothing")


@needs_tracks
@pytest.mark.slow
def test_the_real_track_is_imported_and_sailed(tmp_path):
    """As in the paper: survey the hull of a hand-driven track, on the same water. The samples of
    the track itself are mapped in `tests/mapping/test_quality.py`.
    """
    done = grebe("import", CHINA, "-o", "track.gpkg", "--json", cwd=tmp_path, check=0)
    assert json.loads(done.stdout)["left_out"] == ["Turbidity"]
    assert "Turbidity" in done.stderr
    grebe("plan", CHINA, "-o", "s.gpkg", "--cell", 30, cwd=tmp_path, check=0)
    run = grebe("run", "s.gpkg", "--water", CHINA, "--json", cwd=tmp_path, check=0)
    report = json.loads(run.stdout)
    assert report["reached"] == report["targets"]
    grebe("map", "s.gpkg", "--out", "maps", "--resolution", 6, cwd=tmp_path, check=0)
    grebe("report", "s.gpkg", "-o", "r.html", cwd=tmp_path, check=0)
    page = (tmp_path / "r.html").read_text()
    assert f"{report['samples']} of {report['samples']}" in page
