"""The first mission after installation is the same as all later ones, bit for bit."""

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from conftest import square_survey

import grebe
from grebe.core import kernels
from grebe.workflow.files import write_survey
from grebe.workflow.kernel_cache import compile_controller

GREBE = "from grebe.cli.main import main; main()"
TRACK = "SELECT north_m, east_m, heading_rad, thrust_port_n, thrust_starboard_n FROM track"


def run(package, *words):
    environment = os.environ | {"PYTHONPATH": str(package)}
    subprocess.run(
        [sys.executable, "-c", GREBE, *map(str, words)], env=environment, check=True,
        capture_output=True, timeout=400,
    )  # fmt: skip


@pytest.mark.slow
def test_a_mission_is_the_same_before_and_after_its_kernels_are_cached(tmp_path):
    source, fresh = Path(grebe.__file__).parent, tmp_path / "fresh" / "grebe"
    shutil.copytree(source, fresh, ignore=shutil.ignore_patterns("__pycache__"))
    tracks = []
    for name in ("first.gpkg", "second.gpkg"):
        path = tmp_path / name
        write_survey(path, square_survey(side_m=40.0, cell_m=8.0))
        run(fresh.parent, "run", path)
        with closing(sqlite3.connect(path)) as connection:
            tracks.append(connection.execute(TRACK).fetchall())
    assert len(tracks[0]) > 50
    assert tracks[0] == tracks[1]
    # A boat that waits for a compiler is not steered: nothing was left to compile when it sailed.
    noted = (fresh / "core" / "__pycache__" / "missions_are_compiled").stat().st_mtime
    late = [
        one.name
        for part in ("core", "control", "mission", "links")
        for one in (fresh / part).rglob("*.nbc")
        if one.stat().st_mtime > noted
    ]
    assert not late
    assert list((fresh / "control").rglob("rollout.lagged*.nbc"))


def test_a_changed_source_is_recompiled(tmp_path, monkeypatch):
    (tmp_path / "core").mkdir()
    source = tmp_path / "core" / "kernel.py"
    source.write_text("one")
    monkeypatch.setattr(kernels, "_PACKAGE", tmp_path)
    monkeypatch.setattr(kernels, "_STAMP", tmp_path / "core" / "__pycache__" / "stamp")
    assert not kernels.is_compiled()
    kernels.note_compiled()
    assert kernels.is_compiled()
    source.write_text("another")
    assert not kernels.is_compiled()
    # A kernel in an unchanged file may contain one from a changed file.
    old = tmp_path / "mission" / "__pycache__" / "loop.step-1.py311.1.nbc"
    old.parent.mkdir(parents=True)
    old.write_bytes(b"machine code")
    kernels.forget_compiled()
    assert not old.exists()


def test_what_is_compiled_before_the_first_mission_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels, "_PACKAGE", tmp_path)
    monkeypatch.setattr(kernels, "_STAMP", tmp_path / "core" / "__pycache__" / "stamp")
    fresh = tmp_path / "mapping" / "__pycache__" / "tiles.py311.1.nbc"
    fresh.parent.mkdir(parents=True)
    fresh.write_bytes(b"machine code")
    kernels.forget_compiled()
    assert fresh.exists()


LOADED = """
from numba.core.cpu import CPUContext
prepared, refresh = [], CPUContext.refresh
CPUContext.refresh = lambda self: (prepared.append(self), refresh(self))[1]
from grebe.workflow.kernel_cache import sail_a_little
sail_a_little()
print(len(prepared))
"""


def test_a_mission_s_machine_code_is_loaded_without_the_compiler():
    """Loading what the compiler needs takes a tenth of a second or more.

    An undeclared name that machine code calls would end the process: here all of it is loaded and
    run.
    """
    assert compile_controller()
    done = subprocess.run(
        [sys.executable, "-c", LOADED], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "0"


SHARED = """
from numba.core import event
from grebe.control.solvers.fast import ahead, interior, sqp
from grebe.workflow.kernel_cache import sail_a_little

with event.install_recorder("numba:compile") as compiled:
    ahead.compile_quadratic()
    ahead.compile_horizon()
    ahead.compile_optimise()
    sail_a_little(steered=False)
    sail_a_little()
print(len(compiled.buffer))
parts = (
    interior.minimise, interior.start_rows, interior.start_box, sqp.shoot, sqp.quadratic,
    sqp.search, sqp.unfinished, sqp.optimise,
)
print({len(one.signatures) for one in parts})
"""


def test_what_two_processes_compile_is_what_a_mission_needs():
    """A half for other arguments than the solver's would be compiled in vain, and once more."""
    assert compile_controller()
    done = subprocess.run(
        [sys.executable, "-c", SHARED], capture_output=True, text=True, check=True
    )
    assert done.stdout.split("\n")[:2] == ["0", "{1}"]
