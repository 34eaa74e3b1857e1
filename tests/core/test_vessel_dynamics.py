"""Eq. (9): masses, signs, conservation, symmetry, current."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import states
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.dynamics import CALM, Weather, drive_power_w, rates, rk4
from grebe.core.errors import InputError, VesselError
from grebe.core.vessel import PRESETS, Vessel, paper_masses, vessel_named, with_printed_sign

boats = st.sampled_from(list(PRESETS.values()))
speeds = st.floats(-3, 3)
thrust_pairs = st.tuples(st.floats(-10, 20), st.floats(-10, 20))


def coriolis_power_w(boat, u, v, r):
    """Power of the terms of Eq. (9) that are neither thrust nor drag, computed with `rates`."""
    _, _, _, du, dv, dr = rates(boat, (0, 0, 0, u, v, r), (0.0, 0.0))
    drag = [
        (boat.x_u + boat.x_uu * abs(u)) * u,
        (boat.y_v + boat.y_vv * abs(v)) * v,
        (boat.n_r + boat.n_rr * abs(r)) * r,
    ]
    return (
        u * (boat.m11_kg * du - drag[0])
        + v * (boat.m22_kg * dv - drag[1])
        + r * (boat.m33_kgm2 * dr - drag[2])
    )


@given(boats, speeds, speeds, speeds)
def test_coriolis_terms_do_no_work(boat, u, v, r):
    size = (boat.m22_kg - boat.x_u - boat.y_v - boat.n_r - boat.n_rr) * 100
    assert abs(coriolis_power_w(boat, u, v, r)) <= 1e-12 * size


def test_with_the_printed_sign_they_do():
    printed = with_printed_sign(PRESETS["spyboat"])
    expected = 2 * (printed.m22_kg - printed.m11_kg)
    assert coriolis_power_w(printed, 1.0, 1.0, 1.0) == pytest.approx(expected)


@given(boats, speeds, speeds, speeds)
def test_without_thrust_the_kinetic_energy_falls(boat, u, v, r):
    _, _, _, du, dv, dr = rates(boat, (0, 0, 0, u, v, r), (0.0, 0.0))
    power = boat.m11_kg * u * du + boat.m22_kg * v * dv + boat.m33_kgm2 * r * dr
    assert power <= 1e-9


@given(boats, states(), thrust_pairs)
def test_mirroring_the_boat_mirrors_its_motion(boat, z, thrusts):
    x, y, psi, u, v, r = z
    port, starboard = thrusts
    straight = rates(boat, z, (port, starboard))
    mirrored = rates(boat, (x, -y, -psi, u, -v, -r), (starboard, port))
    signs = (1, -1, -1, 1, -1, -1)
    assert mirrored == pytest.approx(
        [s * a for s, a in zip(signs, straight, strict=True)], abs=1e-9
    )


@given(boats, st.floats(-7, 7), st.floats(-1, 1), st.floats(-1, 1))
def test_a_boat_without_thrust_drifts_with_the_current(boat, psi, north, east):
    weather = (north, east, 0.0, 0.0)
    u = math.cos(psi) * north + math.sin(psi) * east
    v = math.cos(psi) * east - math.sin(psi) * north
    rate = rates(boat, (0, 0, psi, u, v, 0.0), (0.0, 0.0), weather)
    assert rate == pytest.approx([north, east, 0, 0, 0, 0], abs=1e-9)


@given(boats, states(), thrust_pairs, st.floats(-1, 1), st.floats(-1, 1))
def test_a_current_is_a_change_of_frame(boat, z, thrusts, north, east):
    """A track in a current is the still-water track, carried along by the current."""
    psi, duration = z[2], 1.0
    still = rk4(lambda s: rates(boat, s, thrusts), z, duration, 50)
    u_c = math.cos(psi) * north + math.sin(psi) * east
    v_c = math.cos(psi) * east - math.sin(psi) * north
    start = (z[0], z[1], psi, z[3] + u_c, z[4] + v_c, z[5])
    carried = rk4(lambda s: rates(boat, s, thrusts, (north, east, 0, 0)), start, duration, 50)
    assert carried[0] == pytest.approx(still[0] + north * duration, abs=1e-4)
    assert carried[1] == pytest.approx(still[1] + east * duration, abs=1e-4)
    assert carried[2] == pytest.approx(still[2], abs=1e-4)


def test_port_thrust_turns_to_starboard():
    rate = rates(PRESETS["spyboat"], (0, 0, 0, 0, 0, 0), (5.0, 0.0))
    assert rate[5] > 0


def test_masses_follow_the_formulas_below_eq_9():
    """Worked by hand for m = 30, L = 1.3, W = 0.9, D = 0.15, B = 0.7, rho = 1000."""
    masses = paper_masses(
        mass_kg=30, length_m=1.3, width_m=0.9, depth_m=0.15, propeller_distance_m=0.7
    )
    assert masses.m11_kg == pytest.approx(31.5)
    assert masses.m22_kg == pytest.approx(30 + 0.5 * 91.8916, rel=1e-5)
    assert masses.m33_kgm2 == pytest.approx((75.0 + 0.5 * (1.47 + 155.2968)) / 12, rel=1e-5)


def test_presets_reach_the_speeds_of_their_sources():
    """u_max as tabulated with the sources of the presets."""
    table = {"spyboat": 2.5, "blueboat": 2.72, "otter": 3.09, "heron": 1.61, "tianjin": 1.32}
    for name, speed in table.items():
        assert PRESETS[name].speed_max_mps == pytest.approx(speed, abs=0.02)


@given(boats)
def test_top_speed_is_where_drag_takes_all_thrust(boat):
    assert boat.surge_drag_n(boat.speed_max_mps) == pytest.approx(2 * boat.thrust_max_n)


@given(boats, thrust_pairs)
def test_rk4_at_the_chosen_substeps_is_close_to_the_limit(boat, thrusts):
    from grebe.control.turn_and_go import model_substeps

    low, high = boat.thrust_min_n, boat.thrust_max_n
    inputs = [min(max(f, low), high) for f in thrusts]
    z = (0.0, 0.0, 0.3, 1.0, 0.1, 0.1)
    coarse = rk4(lambda s: rates(boat, s, inputs), z, 1.0, model_substeps(boat, 1.0))
    fine = rk4(lambda s: rates(boat, s, inputs), z, 1.0, 200)
    assert np.max(np.abs(np.subtract(coarse, fine))) < 0.02


def test_power_grows_with_thrust_and_vanishes_without():
    boat = PRESETS["spyboat"]
    assert drive_power_w(boat, (0.0, 0.0), 1.0) == 0.0
    assert drive_power_w(boat, (5.0, 5.0), 1.0) < drive_power_w(boat, (6.0, -6.0), 1.0)


def test_an_unknown_vessel_is_answered_with_the_nearest():
    with pytest.raises(VesselError, match="'spyboat'"):
        vessel_named("spybot")


@pytest.mark.parametrize(
    ("field", "value"), [("m11_kg", -1.0), ("x_u", 2.0), ("arm_m", 0.0), ("n_r", float("nan"))]
)
def test_impossible_vessels_are_refused(field, value):
    good = {
        "name": "x", "m11_kg": 10, "m22_kg": 15, "m33_kgm2": 2, "x_u": -1, "y_v": -1, "n_r": -1,
        "arm_m": 0.2, "thrust_max_n": 5, "thrust_min_n": -5,
    }  # fmt: skip
    Vessel(**good)
    with pytest.raises(VesselError, match=field):
        Vessel(**(good | {field: value}))


def test_weather_must_be_finite():
    assert CALM.as_tuple() == (0, 0, 0, 0)
    with pytest.raises(InputError):
        Weather(current_north_mps=float("inf"))


@pytest.mark.parametrize(
    "bad", [{"yaw_coupling": "Fossen"}, {"m11_kg": True}, {"m11_kg": "23"}], ids=str
)
def test_a_vessel_says_what_is_wrong_with_it(bad):
    with pytest.raises(VesselError, match=next(iter(bad))):
        replace(PRESETS["spyboat"], **bad)


@pytest.mark.parametrize("mass_kg", [-1.0, 0.0, float("nan")])
def test_a_hull_without_a_mass_has_none(mass_kg):
    with pytest.raises(VesselError, match="above 0"):
        paper_masses(mass_kg=mass_kg, length_m=1, width_m=1, depth_m=1, propeller_distance_m=1)
