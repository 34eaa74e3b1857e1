"""Figures 4 to 6, and the study of the paper's claim."""

import json
from itertools import islice

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import CHINA as TRACK
from conftest import needs_tracks

from grebe.cli.main import grebe
from grebe.core.errors import UsageError
from grebe.paper import claim
from grebe.paper.hand_driven import HandDriven
from grebe.paper.hand_figures import HAND_FIGURES

pytestmark = needs_tracks


@pytest.fixture(scope="module")
def hand():
    return HandDriven.read(TRACK)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(HAND_FIGURES))
def test_each_figure_shows_what_it_must(tmp_path, hand, name):
    made = HAND_FIGURES[name](tmp_path, hand)
    assert made.holds, made.checks
    assert made.picture.exists()


def test_the_settled_samples_alone_count(hand):
    assert np.isnan(hand.good["ph"][:50]).all()
    assert np.isfinite(hand.raw.values["ph"][:50]).all()
    assert hand.duration_s == pytest.approx(3797, abs=1)


@pytest.mark.slow
def test_compared_surveys_have_equal_duration_or_length(hand, monkeypatch):
    """The search is tested with the lengths of plans, since sailing each trial takes minutes."""

    def as_planned(survey, method):
        outcome = survey.outcome
        places = np.array([target.set.centre for target in survey.targets])
        return claim.Sampled(
            method=method, positions=places, length_m=outcome.length_m, duration_s=outcome.time_s
        )

    monkeypatch.setattr(claim, "sailed", as_planned)
    driven, timed, length = claim.samplings(hand)
    assert timed.duration_s <= driven.duration_s
    assert 0.9 * driven.length_m < length.length_m <= driven.length_m


@pytest.mark.slow
def test_the_same_water_is_sampled_by_both_methods(hand):
    """For one water, the planned survey of the same duration mostly makes the better map."""
    driven, timed = samplings = claim.samplings(hand, same_length=False)
    assert timed.duration_s <= driven.duration_s
    # Two of the four quantities: all maps take minutes, and `grebe paper claim` makes them.
    scores = list(islice(claim.measure(hand, samplings, seeds=1), 2 * 2))
    assert len({score.quantity for score in scores}) == 2
    rows = claim.summary(scores)
    base = [row["rmse"] for row in rows if row["way"] == driven.method]
    better = [row["rmse"] for row in rows if row["way"] == timed.method]
    assert np.mean(np.array(better) < np.array(base)) > 0.5


def test_the_command_asks_for_a_track(tmp_path):
    done = CliRunner().invoke(grebe, ["paper", "fig5", "--out", str(tmp_path)])
    assert isinstance(done.exception, UsageError)
    made = CliRunner().invoke(
        grebe, ["paper", "fig4", "--track", str(TRACK), "--out", str(tmp_path), "--json"]
    )
    assert json.loads(made.stdout)[0]["figure"] == "fig4"
