"""Plans for accuracy predict what kriging then finds, and choose the most accurate map."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME, run_simulated

from grebe.cli.plan_command import command
from grebe.core.errors import GrebeError, InputError, PlanError, UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mapping.fields.kriging import krige
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.workflow.accuracy import (
    CHOICES,
    NODES,
    expected,
    plan_for_accuracy,
    prior_of_range,
    prior_of_survey,
)
from grebe.workflow.files import write_survey

REGION = Region(name="x", frame=FRAME, water=shapely.box(0, 0, 80, 110))
BOAT = PRESETS["spyboat"]


@pytest.mark.slow
def test_the_expected_sd_is_that_of_the_sailed_samples(tmp_path):
    planned = plan(REGION, BOAT, PlanSettings(cell_m=15.0))
    prior = prior_of_range(80.0)
    foreseen = expected(planned, prior)
    path = tmp_path / "s.gpkg"
    write_survey(path, planned.survey)
    with SurveyFile.open(path) as file:
        assert run_simulated(file).complete
        at = file.samples().positions
    nodes = foreseen.grid.nodes
    left = krige(at, np.zeros(len(at)), nodes, prior).variance
    assert foreseen.share == pytest.approx(math.sqrt(left.mean()), rel=0.08)
    assert len(nodes) == pytest.approx(NODES, rel=0.1)


def test_more_time_and_a_longer_range_make_it_surer():
    shares = [
        expected(plan(REGION, BOAT, PlanSettings(cell_m=cell_m)), prior_of_range(range_m)).share
        for cell_m, range_m in ((25.0, 40.0), (12.0, 40.0), (12.0, 120.0))
    ]
    assert shares[0] > shares[1] > shares[2]


@pytest.mark.slow
def test_the_surest_plan_within_the_budget_is_taken():
    settings = PlanSettings(cell_m=None, minutes=6.0)
    found = plan_for_accuracy(REGION, BOAT, settings, prior_of_range(60.0))
    assert len(found.tried) == CHOICES
    assert found.best.share == min(one.share for one in found.tried)
    assert all(one.planned.outcome.time_s <= 360.0 for one in found.tried)


@pytest.mark.slow
def test_an_accuracy_that_is_asked_for_is_kept_in_the_shortest_time():
    found = plan_for_accuracy(
        REGION, BOAT, PlanSettings(cell_m=5.0), prior_of_range(80.0), sd_share=0.5
    )
    assert all(0.4 < one.share <= 0.5 for one in found.tried)
    times = [one.planned.outcome.time_s for one in found.tried]
    assert times == sorted(times)


def test_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(UsageError, match="positive number of metres"):
        prior_of_range(math.nan)
    with pytest.raises(UsageError, match="needs minutes"):
        plan_for_accuracy(REGION, BOAT, PlanSettings(cell_m=9.0), prior_of_range(60.0))
    wishes = PlanSettings(cell_m=None, minutes=0.1)
    with pytest.raises(PlanError):
        plan_for_accuracy(REGION, BOAT, wishes, prior_of_range(60.0))
    path = tmp_path / "s.gpkg"
    write_survey(path, plan(REGION, BOAT, PlanSettings(cell_m=20.0)).survey)
    with pytest.raises(InputError, match="Nothing that"):
        prior_of_survey(path)
    with pytest.raises(InputError, match="no quantity 'gold'"):
        prior_of_survey(path, "gold")


@pytest.mark.slow
def test_an_earlier_survey_says_how_the_water_varies(simulated_survey):
    finest = prior_of_survey(simulated_survey[0])
    of_one = prior_of_survey(simulated_survey[0], "ph")
    assert finest.sill == of_one.sill == 1.0
    assert finest.practical_range_m <= of_one.practical_range_m


CORNERS = [[6.55, 46.45], [6.5508, 46.45], [6.5508, 46.4506], [6.55, 46.4506], [6.55, 46.45]]
OUTLINE = {"type": "Polygon", "coordinates": [CORNERS]}


@pytest.fixture
def outline(tmp_path):
    path = tmp_path / "lake.geojson"
    path.write_text(json.dumps(OUTLINE))
    return path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--sd", "0.5"), "requires --goal accuracy"),
        (("--goal", "accuracy"), "give --range or --like"),
        (("--goal", "accuracy", "--range", "50"), "needs --minutes or --wh"),
        (("--goal", "accuracy", "--range", "50", "--cell", "9"), "chooses the cells' size"),
        (("--goal", "accuracy", "--range", "50", "--minutes", "9", "--sd", "0.5"), "or else --sd"),
    ],
)
def test_options_that_do_not_go_together_are_named(outline, tmp_path, words, said):
    done = CliRunner().invoke(command, [str(outline), "-o", str(tmp_path / "s.gpkg"), *words])
    assert isinstance(done.exception, GrebeError)
    assert said in str(done.exception)


@pytest.mark.slow
def test_the_command_draws_how_sure_the_map_will_be(outline, tmp_path):
    to = tmp_path / "s.gpkg"
    words = ["--goal", "accuracy", "--minutes", "4", "--range", "50", "--json"]
    done = CliRunner().invoke(command, [str(outline), "-o", str(to), *words])
    assert done.exception is None, done.exception
    told = json.loads(done.stdout)
    assert 0 < told["expected_sd"] < 1
    assert len(told["tried"]) == CHOICES
    assert (tmp_path / "s-expected.png").stat().st_size > 10_000
