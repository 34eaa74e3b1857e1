"""grebe adapt: a survey goes on where it pays, and what cannot be is said."""

from __future__ import annotations

import json

import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME, simulate

from grebe.cli.adapt_command import command
from grebe.core.errors import GrebeError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region
from grebe.workflow.files import write_survey


@pytest.fixture
def path(tmp_path):
    region = Region(name="x", frame=FRAME, water=shapely.box(0, 0, 90, 90))
    path = tmp_path / "s.gpkg"
    settings = PlanSettings(cell_m=30.0, core=0.4, shore_margin_m=3.0)
    write_survey(path, plan_survey(region, PRESETS["spyboat"], settings))
    return path


def adapt(path, *words):
    return CliRunner().invoke(command, [str(path), *map(str, words), "--json"])


@pytest.mark.slow
def test_a_survey_goes_on_where_it_pays_and_its_map_becomes_surer(path):
    with SurveyFile.open(path) as file:
        assert simulate(file).complete
    words = ("--quantity", "temperature_degc", "--minutes", 2)
    done = adapt(path, *words)
    assert done.exception is None, done.exception
    told = json.loads(done.stdout)
    assert told["revision"] == 2
    assert 0 < told["sd_expected [°C]"] < told["sd_now [°C]"]
    with SurveyFile.open(path) as file:
        assert file.revision.reason == "adaptive"
        new = file.survey.targets[file.progress().reached :]
        assert sum(target.kind == "cell" for target in new) == told["places"]
        assert all(file.survey.water.buffer(-2.9).covers(t.set.polygon) for t in new)
        before = file.count("samples")
        report = simulate(file, resume=True)
        assert report.complete
        assert report.duration_s < 1.4 * 120.0
        assert file.count("samples") > before
    again = adapt(path, *words, "--goal", "threshold", "--threshold", 21.0)
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
def test_what_cannot_be_is_said(path, words, said):
    with SurveyFile.open(path) as file:
        simulate(file)
    done = adapt(path, *words)
    assert isinstance(done.exception, GrebeError)
    assert said in str(done.exception)


def test_a_survey_that_was_not_sailed_cannot_go_on(path):
    done = adapt(path, "--quantity", "ph", "--minutes", 2)
    assert "run it first" in str(done.exception)
