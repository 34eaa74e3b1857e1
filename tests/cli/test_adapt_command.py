"""grebe adapt: a finished survey is extended, and impossible requests are refused with a reason."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from conftest import region_of, run_simulated

from grebe.cli.adapt_command import command
from grebe.core.errors import GrebeError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.workflow.files import write_survey


def adapt(path, *words):
    return CliRunner().invoke(command, [str(path), *map(str, words), "--json"])


@pytest.mark.slow
def test_a_survey_goes_on_where_it_pays_and_its_map_becomes_surer(coarse_survey):
    with SurveyFile.open(coarse_survey) as file:
        assert run_simulated(file).complete
    words = ("--quantity", "temperature_degc", "--minutes", 2)
    done = adapt(coarse_survey, *words)
    assert done.exception is None, done.exception
    told = json.loads(done.stdout)
    assert told["revision"] == 2
    assert 0 < told["sd_expected [°C]"] < told["sd_now [°C]"]
    with SurveyFile.open(coarse_survey) as file:
        assert file.revision.reason == "adaptive"
        new = file.survey.targets[file.progress().reached :]
        assert sum(target.kind == "cell" for target in new) == told["places"]
        assert all(file.survey.water.buffer(-2.9).covers(t.set.polygon) for t in new)
        before = file.count("samples")
        report = run_simulated(file, resume=True)
        assert report.complete
        assert report.duration_s < 1.4 * 120.0
        assert file.count("samples") > before
    again = adapt(coarse_survey, *words, "--goal", "threshold", "--threshold", 21.0)
    assert again.exception is None
    assert json.loads(again.stdout)["revision"] == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--quantity", "gold", "--minutes", 2), "no quantity 'gold'"),
        (("--quantity", "ph", "--minutes", 2, "--goal", "threshold"), "needs a threshold"),
        (("--quantity", "ph", "--minutes", -2), "impossible"),
        (("--quantity", "ph", "--minutes", 0.01), "give more"),
    ],
)
def test_impossible_options_are_reported(coarse_survey, words, said):
    with SurveyFile.open(coarse_survey) as file:
        run_simulated(file)
    done = adapt(coarse_survey, *words)
    assert isinstance(done.exception, GrebeError)
    assert said in str(done.exception)


def test_a_survey_that_was_not_sailed_cannot_go_on(coarse_survey):
    done = adapt(coarse_survey, "--quantity", "ph", "--minutes", 2)
    assert "run it first" in str(done.exception)


def test_a_small_pond_has_places_to_go_to(tmp_path):
    path = tmp_path / "pond.gpkg"
    region = region_of([(0, 0), (32, 0), (32, 32), (0, 32)])
    settings = PlanSettings(cell_m=8.0, shore_margin_m=1.0)
    write_survey(path, plan_survey(region, PRESETS["spyboat"], settings))
    with SurveyFile.open(path) as file:
        assert run_simulated(file).complete
    done = adapt(path, "--quantity", "temperature_degc", "--minutes", 2)
    assert done.exception is None, done.exception
    assert json.loads(done.stdout)["places"] > 3
