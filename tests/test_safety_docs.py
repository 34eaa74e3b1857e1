"""The page on safety names every cause, every reason and the tests that show them."""

import re
from pathlib import Path

import pytest

from grebe.core.dynamics import CALM
from grebe.core.events import EndReason
from grebe.core.vessel import PRESETS
from grebe.mission.safety.fence import braking_distance_m
from grebe.mission.safety.states import ENDS, Cause, SafetyState

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "safety.md").read_text()
ROWS = [line for line in PAGE.splitlines() if line.startswith("| ")]


@pytest.mark.parametrize("code", [*Cause, *EndReason, *SafetyState], ids=lambda one: one.value)
def test_every_state_cause_and_reason_is_on_the_page(code):
    assert f"`{code.value}`" in PAGE


@pytest.mark.parametrize("cause", ENDS, ids=lambda one: one.value)
def test_what_ends_a_mission_stands_in_the_row_of_its_cause(cause):
    rows = [row for row in ROWS if f"`{cause.value}`" in row]
    assert any(f"`{ENDS[cause].value}`" in row for row in rows)


def test_every_row_of_causes_names_tests_and_they_exist():
    written = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    causes = PAGE.split("## Causes")[1].split("## ")[0]
    rows = [line for line in causes.splitlines() if line.startswith("| ")][2:]
    assert len(rows) > 10
    for row in rows:
        names = re.findall(r"`(test_\w+)`", row)
        assert names, row
        for name in names:
            assert f"def {name}(" in written, name


def test_the_table_of_braking_distances_is_what_the_code_computes():
    for name, boat in PRESETS.items():
        row = next(row for row in ROWS if row.startswith(f"| {name} "))
        for speed, text in zip((0.5, 1.0, 1.5), row.split("|")[2:5], strict=True):
            if text.strip() != "-":
                found = braking_distance_m(boat, speed, CALM)
                assert float(text) == pytest.approx(found, abs=0.011)
