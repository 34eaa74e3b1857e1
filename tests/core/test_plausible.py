"""A vessel's numbers in other units show in how they go together."""

from dataclasses import replace

import pytest
from conftest import square_survey

from grebe.core.plausible import doubts_about
from grebe.core.vessel import PRESETS
from grebe.workflow.plans import plan_warnings

BOAT = PRESETS["blueboat"]


@pytest.mark.parametrize("vessel", PRESETS.values(), ids=PRESETS)
def test_no_preset_is_doubted(vessel):
    assert doubts_about(vessel) == []


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"m11_kg": 41770.0, "m22_kg": 22558.0, "m33_kgm2": 25649.0}, "masses in kilograms"),
        ({"m11_kg": 0.042, "m22_kg": 0.023, "m33_kgm2": 0.026}, "masses in kilograms"),
        ({"arm_m": 28.5}, "arm and inertia in metres"),
        ({"arm_m": 0.000285}, "arm and inertia in metres"),
        ({"thrust_max_n": 1900.0, "thrust_min_n": -1100.0}, "thrusts in newtons"),
        ({"thrust_max_n": 0.4, "thrust_min_n": -0.3}, "thrusts in newtons"),
    ],
)
def test_numbers_in_other_units_are_doubted(other, said):
    doubts = doubts_about(replace(BOAT, **other))
    assert doubts
    assert said in doubts[0]


def test_a_plan_tells_the_doubts():
    survey = replace(square_survey(), vessel=replace(BOAT, arm_m=28.5))
    assert [text for text in plan_warnings(survey) if "28.5 m from the middle" in text]
    assert not [text for text in plan_warnings(square_survey()) if "middle" in text]
