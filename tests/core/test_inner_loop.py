"""A boat under speed control is Eq. (9) with other parameters, and follows its orders."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.dynamics import CALM, Weather, rates, rk4
from grebe.core.errors import VesselError
from grebe.core.inner_loop import (
    LEAST_ASTERN_SHARE,
    braking_share,
    held_motion,
    surge_time_s,
    under_speed_control,
    yaw_rate_max_radps,
    yaw_time_s,
)
from grebe.core.vessel import PRESETS

HULLS = st.sampled_from(sorted(PRESETS)).map(PRESETS.__getitem__)


def after(vessel, thrusts, seconds, state=(0.0,) * 6, weather=CALM):
    return rk4(lambda z: rates(vessel, z, thrusts, weather.as_tuple()), state, seconds, 2000)


@given(HULLS, st.floats(0.3, 3.0), st.floats(0.2, 2.0), st.floats(0.3, 5.0))
def test_the_limits_and_the_lags_are_those_that_were_given(hull, surge_s, yaw_s, limit):
    boat = under_speed_control(hull, speed_max_mps=limit, surge_lag_s=surge_s, yaw_lag_s=yaw_s)
    assert boat.speed_max_mps == pytest.approx(min(limit, hull.speed_max_mps))
    assert surge_time_s(boat) == pytest.approx(surge_s)
    assert yaw_time_s(boat) == pytest.approx(yaw_s)
    assert yaw_rate_max_radps(boat) == pytest.approx(yaw_rate_max_radps(hull))
    ahead = after(boat, (boat.thrust_max_n,) * 2, surge_s)
    assert ahead[3] == pytest.approx((1 - math.exp(-1)) * boat.speed_max_mps, rel=1e-6)


@given(HULLS)
def test_by_default_nothing_is_asked_that_the_hull_at_rest_cannot_do(hull):
    boat = under_speed_control(hull)
    full = (boat.thrust_max_n, boat.thrust_max_n)
    spin = (boat.thrust_max_n, boat.thrust_min_n)
    at_rest = (0.0,) * 6
    hulls = rates(hull, at_rest, (hull.thrust_max_n,) * 2)[3]
    assert rates(boat, at_rest, full)[3] <= hulls * (1 + 1e-9)
    assert rates(boat, at_rest, spin)[5] == pytest.approx(
        rates(hull, at_rest, (hull.thrust_max_n, hull.thrust_min_n))[5]
    )


@given(HULLS, st.floats(0.3, 5.0) | st.none(), st.floats(0, 1))
def test_a_model_is_trusted_with_no_more_braking_than_the_hull_has(hull, surge_s, share):
    boat = under_speed_control(hull, surge_lag_s=surge_s)
    trusted = braking_share(hull, boat)
    assert 0 < trusted <= 1
    state = (0.0, 0.0, 0.0, share * hull.speed_max_mps, 0.0, 0.0)
    slowed = rates(boat, state, (trusted * boat.thrust_min_n,) * 2)[3]
    hulls = rates(hull, state, (hull.thrust_min_n,) * 2)[3]
    astern = 2 * trusted * boat.thrust_min_n / boat.x_u
    if surge_s is None or astern > LEAST_ASTERN_SHARE * hull.speed_max_mps * (1 + 1e-9):
        assert -slowed <= -hulls * (1 + 1e-6)


@given(
    HULLS,
    st.floats(-1, 1),
    st.floats(-1, 1),
    st.floats(-0.4, 0.4),
    st.floats(-0.4, 0.4),
    st.floats(-3, 3),
)
def test_an_inner_loop_that_follows_the_motion_moves_as_the_equation_says(
    hull, port, starboard, north, east, heading
):
    """With the right lags, u' = (u_ref - u) / T_u is the surge that the model predicts."""
    boat = under_speed_control(hull)
    weather = Weather(current_north_mps=north, current_east_mps=east, wind_force_north_n=2.0)
    thrusts = (boat.thrust_of(port), boat.thrust_of(starboard))
    state = (0.0, 0.0, heading, 0.7, 0.1, 0.2)
    surge, yaw_rate = held_motion(boat, state, thrusts, weather)
    predicted = rates(boat, state, thrusts, weather.as_tuple())
    assert (surge - state[3]) / surge_time_s(boat) == pytest.approx(predicted[3], abs=1e-9)
    assert (yaw_rate - state[5]) / yaw_time_s(boat) == pytest.approx(predicted[5], abs=1e-9)


def test_a_steady_boat_is_ordered_the_speed_that_it_has():
    boat = under_speed_control(PRESETS["blueboat"], speed_max_mps=2.0)
    half = 0.5 * boat.surge_drag_n(1.2)
    steady = (0.0, 0.0, 0.3, 1.2, 0.0, 0.0)
    assert held_motion(boat, steady, (half, half), CALM) == pytest.approx((1.2, 0.0))


@pytest.mark.parametrize("what", ["speed_max_mps", "surge_lag_s", "yaw_lag_s"])
def test_limits_and_lags_are_positive(what):
    with pytest.raises(VesselError, match="give more than 0"):
        under_speed_control(PRESETS["heron"], **{what: 0.0})
