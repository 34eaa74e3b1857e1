"""Difficulties besides the weather: lag, dead band, another hull, bad estimates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import NOON, run_simulated, square_survey
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.control.rules.lookahead import Lookahead
from grebe.core.errors import UsageError, VesselError
from grebe.core.vessel import PRESETS, vessel_named
from grebe.io.store import SurveyFile
from grebe.links.base import Observation
from grebe.links.simulated import EstimateErrors, SimulatedLink
from grebe.mission.estimates import BLIND_S
from grebe.mission.events.recorders import SurveyRecorder
from grebe.mission.loop import Mission
from grebe.simulation.plant import UNCERTAIN, Plant, mismatched
from grebe.simulation.sonde import Sonde
from grebe.simulation.water import free_water
from grebe.workflow.simulated import SimulatedWorld

REST = (0.0,) * 6


def test_thrusts_within_the_dead_band_come_to_nothing():
    plant = Plant(replace(vessel_named("spyboat"), thruster_dead_band_n=1.0), REST)
    plant.command((0.9, -0.9))
    plant.advance(1.0)
    assert plant.state == list(REST)
    plant.command((1.1, 1.1))
    plant.advance(1.0)
    assert plant.state[3] > 0


def test_a_lagging_thruster_reaches_63_percent_after_its_time_constant():
    plant = Plant(vessel_named("otter"), REST)
    plant.command((100.0, 100.0))
    plant.advance(plant.vessel.thruster_lag_s)
    assert plant.thrusts[0] == pytest.approx(100 * (1 - math.exp(-1)), rel=1e-6)


@pytest.mark.parametrize("band", [-1.0, 1e9, math.nan])
def test_an_impossible_dead_band_is_refused(band):
    with pytest.raises(VesselError, match="dead_band"):
        replace(vessel_named("spyboat"), thruster_dead_band_n=band)


@given(share=st.floats(0, 0.5), seed=st.integers(0, 1000))
def test_a_mismatched_boat_differs_by_no_more_than_it_may(share, seed):
    for boat in PRESETS.values():
        other = mismatched(boat, share, seed)
        for name in UNCERTAIN:
            allowed = share * abs(getattr(boat, name)) + 1e-9
            assert abs(getattr(other, name) - getattr(boat, name)) <= allowed


@pytest.mark.parametrize("wrong", [{"velocity_mps": -1.0}, {"lost_share": 1.0}])
def test_impossible_errors_of_estimates_are_refused(wrong):
    with pytest.raises(UsageError):
        EstimateErrors(**wrong)


def test_errors_of_estimates_have_the_size_that_is_asked_for():
    survey = square_survey()
    sonde = Sonde(free_water(survey.water.bounds, 1), 1)
    errors = EstimateErrors(position_m=0.5, velocity_mps=0.02, lost_share=0.2)
    link = SimulatedLink(Plant(survey.vessel, REST), sonde, errors, seed=3)
    seen = [link.observe() for _ in range(2000)]
    states = np.array([o.state for o in seen])
    assert states[:, 0].std() == pytest.approx(0.5, rel=0.1)
    assert states[:, 3].std() == pytest.approx(0.02, rel=0.1)
    assert np.all(states[:, 2] == 0)
    # One estimate in five is lost, so the mean interval is a quarter longer.
    assert seen[-1].time_s / (0.1 * 1999) == pytest.approx(1.25, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mission_completes_with_another_hull_noise_and_lost_estimates(tmp_path, seed):
    world = SimulatedWorld(
        mismatch=0.2, errors=EstimateErrors(velocity_mps=0.02, lost_share=0.2), seed=seed
    )
    survey = square_survey(side_m=30.0)
    with SurveyFile.create(tmp_path / "r.gpkg", survey, meta={}, force=True) as file:
        assert run_simulated(file, Lookahead(), world).complete


class Blinking(SimulatedLink):
    """A link whose estimates are not numbers for a while."""

    first, last, seen, stopped_at = 60, 100, 0, None

    def observe(self):
        self.seen += 1
        observation = super().observe()
        if self.first <= self.seen < self.last:
            return Observation(time_s=observation.time_s, state=(math.nan,) * 6)
        return observation

    def command(self, order):
        if self.first <= self.seen < self.last and self.stopped_at is None:
            # The boat is braked by dead reckoning, without thrust ahead.
            assert max(order.thrusts) <= 0
            self.stopped_at = self.seen
        super().command(order)


def test_a_blind_boat_stops_and_resumes_with_the_next_estimate(tmp_path):
    survey = square_survey(side_m=30.0)
    sonde = Sonde(free_water(survey.water.bounds, 1), 1)
    link = Blinking(Plant(survey.vessel, survey.start.at_rest()), sonde)
    with SurveyFile.create(tmp_path / "b.gpkg", survey, meta={}, force=True) as file:
        report = Mission(
            survey, Controller(survey.vessel, survey.sets), link, SurveyRecorder(file), started=NOON
        ).run()
        codes = [event.code for event in file.events()]
    assert report.complete
    assert codes.count("estimate_invalid") == 40
    assert 0.1 * (link.stopped_at - 59) == pytest.approx(BLIND_S, abs=0.11)
