"""The settings of a plan are stored completely: nothing is lost on the way to the file and back."""

import dataclasses
import json

import pytest
import shapely
from conftest import region_of
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.dynamics import Weather
from grebe.core.plan_settings import (
    PATTERNS,
    SHAPES,
    FleetSettings,
    PlanOutcome,
    PlanSettings,
    SortieSettings,
)
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.io.store.plan_tables import (
    outcome_text,
    parse_outcome,
    parse_settings,
    settings_text,
)
from grebe.planning.planner import plan

positive = st.floats(1e-3, 1e6)
weathers = st.builds(Weather, *[st.floats(-3, 3)] * 0, current_north_mps=st.floats(-3, 3),
                     wind_force_east_n=st.floats(-9, 9))  # fmt: skip


degrees = st.tuples(st.floats(-180, 180), st.floats(-90, 90))
fleets = st.builds(FleetSettings, boats=st.just(2), apart_m=positive,
                   starts=st.just(()) | st.tuples(degrees, degrees))  # fmt: skip
bounds = {"reserve": st.floats(0, 0.9), "harbours": st.just(()) | st.tuples(degrees)}
sorties_alike = st.builds(SortieSettings, battery_wh=positive, minutes=st.none() | positive,
                          **bounds)  # fmt: skip
sorties_unlike = st.builds(SortieSettings, batteries_wh=st.tuples(positive, positive),
                           minutes_each=st.just(()) | st.tuples(positive, positive),
                           **bounds)  # fmt: skip


@st.composite
def plan_settings(draw):
    size = draw(st.sampled_from(("cell_m", "minutes", "energy_wh")))
    fleet = draw(st.none() | fleets)
    return PlanSettings(
        **({"cell_m": None} | {size: draw(positive)}),
        shape=draw(st.sampled_from(SHAPES)),
        pattern=draw(st.sampled_from(PATTERNS)),
        core=draw(st.floats(0.2, 1.0)),
        angle_deg=draw(st.none() | st.floats(-180, 180)),
        speed_min_mps=draw(st.floats(0, 1)),
        speed_max_mps=draw(st.floats(1.1, 3)),
        shore_margin_m=draw(st.floats(0, 50)),
        returns=draw(st.booleans()),
        weather=draw(weathers),
        fleet=fleet,
        sorties=draw(st.none() | sorties_alike | (sorties_unlike if fleet else st.nothing())),
    )


@given(plan_settings())
def test_settings_come_back_exactly(settings):
    assert parse_settings(settings_text(settings)) == settings


@given(plan_settings())
def test_every_setting_is_in_the_text_that_the_hash_is_made_of(settings):
    """A plan in one piece has the same text and hash as before there were sorties and fleets."""
    named = {field.name for field in dataclasses.fields(PlanSettings)}
    absent = {name for name in ("sorties", "fleet") if getattr(settings, name) is None}
    assert set(json.loads(settings_text(settings))) == named - absent


def test_sorties_of_one_battery_have_the_text_that_they_had_before_boats_had_their_own():
    text = settings_text(PlanSettings(sorties=SortieSettings(battery_wh=90.0)))
    assert json.loads(text)["sorties"] == {
        "battery_wh": 90.0, "minutes": None, "reserve": 0.2, "harbours": [],
    }  # fmt: skip
    assert parse_settings(text).sorties == SortieSettings(battery_wh=90.0)


def test_an_outcome_comes_back_and_a_survey_that_was_not_planned_has_none():
    names = [field.name for field in dataclasses.fields(PlanOutcome) if field.name != "method"]
    outcome = PlanOutcome(**dict.fromkeys(names, 1.5), method="greedy")
    assert parse_outcome(outcome_text(outcome)) == outcome
    assert parse_outcome(outcome_text(None)) is None
    assert parse_settings(settings_text(None)) is None


@pytest.mark.parametrize("core", [1.0, 0.4])
def test_a_target_knows_its_cell_in_the_file_too(tmp_path, core):
    region = region_of([(0, 0), (21, 0), (25, 18), (0, 21)])
    settings = PlanSettings(cell_m=7.0, core=core, returns=True, pattern="rows")
    planned = plan(region, PRESETS["spyboat"], settings)
    with SurveyFile.create(tmp_path / "s.gpkg", planned.survey, meta={}, force=False) as file:
        back = file.survey
    assert back.settings == settings
    assert back.outcome == planned.outcome
    assert planned.survey.coverage == pytest.approx(1.0, abs=2e-3)
    assert back.coverage == pytest.approx(planned.survey.coverage, abs=1e-6)
    for target, again in zip(planned.survey.targets, back.targets, strict=True):
        if target.kind == "transit":
            assert target.cell is None
            assert again.cell is None
            continue
        assert shapely.hausdorff_distance(target.cell, again.cell) < 1e-6
        assert target.set.polygon.area == pytest.approx(core**2 * target.cell.area)
