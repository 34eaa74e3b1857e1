"""The manoeuvre keeps to its circle and speed limit, with boats that differ from their model."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import square_survey
from identification.drives import NOISE, boat_unlike, manoeuvre_of

from grebe.core.errors import PlanError, UsageError
from grebe.core.vessel import PRESETS
from grebe.identification.free_water import circle_in
from grebe.identification.manoeuvre import Circle, Manoeuvre, programme, stopping_m

HERE = Circle(north_m=0.0, east_m=0.0, radius_m=40.0)


@pytest.mark.parametrize("name", ["spyboat", "otter", "heron", "blueboat", "tianjin"])
def test_it_keeps_inside_its_circle_and_near_its_speed(name):
    preset = PRESETS[name]
    true = boat_unlike(preset, 1, lag_s=0.5)
    log, truth = manoeuvre_of(true, preset, 1, latency_s=0.2, radius_m=40.0)
    assert np.hypot(truth[:, 0], truth[:, 1]).max() < 40.0
    assert np.abs(truth[:, 3]).max() < 1.35 * 0.8 * preset.speed_max_mps
    assert log.duration_s == pytest.approx(180.0, abs=0.2)


def test_it_asks_for_every_kind_of_motion():
    log, truth = manoeuvre_of(PRESETS["benchmark"], PRESETS["benchmark"], noise=0 * NOISE)
    assert truth[:, 3].min() < -0.3
    assert truth[:, 3].max() > 0.5 * PRESETS["benchmark"].speed_max_mps
    assert truth[:, 5].min() < -0.3
    assert truth[:, 5].max() > 0.3
    assert (log.commands == 0).all(axis=1).any(), "it coasts"


def test_a_boat_that_starts_outside_comes_in_first():
    boat = PRESETS["benchmark"]
    manoeuvre = Manoeuvre(boat, HERE, speed_max_mps=1.0)
    outside = (-100.0, 0.0, math.pi, 0.0, 0.0, 0.0)
    port, starboard = manoeuvre.thrusts(0.0, outside)
    assert port * starboard < 0, "it turns about"
    ahead = (-100.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert min(manoeuvre.thrusts(500.0, ahead)) > 0
    assert not manoeuvre.is_over, "the time counts from when it is in the circle"


def test_a_circle_without_room_to_stop_is_refused():
    boat = PRESETS["otter"]
    with pytest.raises(PlanError, match="too small") as caught:
        Manoeuvre(boat, replace(HERE, radius_m=5.0), speed_max_mps=2.5)
    assert caught.value.settings == ("radius_m", "speed_max_mps")
    assert stopping_m(boat, 2.0) > stopping_m(boat, 1.0) > stopping_m(boat, 0.0) == 0.0
    with pytest.raises(UsageError):
        Manoeuvre(boat, HERE, speed_max_mps=0.0)
    with pytest.raises(UsageError):
        replace(HERE, radius_m=0.0)


def test_the_programme_fills_its_time_and_is_the_same_each_time():
    legs = programme(240.0)
    assert sum(leg.duration_s for leg in legs) == pytest.approx(240.0)
    assert legs == programme(240.0)
    assert legs != programme(240.0, seed=1)


def test_the_circle_lies_in_free_water_and_is_reached_without_land_between():
    survey = square_survey(100.0)
    circle = circle_in(survey, (10.0, 10.0))
    area = shapely.Point(circle.north_m, circle.east_m).buffer(circle.radius_m)
    assert survey.water.buffer(0.1).covers(area)
    asked = circle_in(survey, (10.0, 10.0), 20.0)
    assert (asked.north_m, asked.east_m) == pytest.approx((20.0, 20.0), abs=0.5)
    wall = shapely.box(30.0, -1.0, 40.0, 101.0)
    cut = replace(survey, no_go=(wall,))
    with pytest.raises(PlanError, match="in a straight line"):
        circle_in(cut, (10.0, 50.0), 25.0)
    with pytest.raises(PlanError, match="no free circle"):
        circle_in(survey, (10.0, 10.0), 80.0)
