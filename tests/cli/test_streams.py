"""Output that nobody may be reading: full and closed streams, and logs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from grebe.cli.output import LONGEST_SILENCE_S, Pace

GREBE = f"{sys.executable} -c 'from grebe.cli.main import main; main()'"


def shell(words):
    return subprocess.run(
        f"{GREBE} {words}", shell=True, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize("words", ["", "--help", "plan --help"])
def test_a_full_standard_output_is_named(words):
    done = shell(f"{words} > /dev/full")
    assert done.returncode == 3
    assert done.stderr == ("grebe: standard output cannot be written: No space left on device.\n")


@pytest.mark.parametrize("closed", ["2> /dev/full", "2>&-", "<&- 2>&-"])
def test_a_command_does_not_depend_on_who_watches(closed):
    assert shell(f"--help {closed}").returncode == 0
    assert shell(f"show nothing.gpkg {closed}").returncode == 3


def test_a_closed_standard_output_ends_nothing():
    done = shell("--help >&-")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_log_gets_progress_in_tenths_and_the_time_left():
    now = 0.0
    pace = Pace(lambda: now)
    assert pace.is_due(100, 1000)  # earlier work does not count towards the pace
    assert pace.left_s(100, 1000) is None
    now = 10.0
    assert not pace.is_due(150, 1000)
    assert pace.is_due(200, 1000)
    assert pace.left_s(200, 1000) == pytest.approx(80.0)
    now = 10.0 + LONGEST_SILENCE_S
    assert pace.is_due(200, 1000)
    assert not pace.is_due(200, 1000)
