"""A MAVLink boat, sailed over a line in memory by real bytes: orders, faults, refusals."""

import math
import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from links.boats import EXACT, SURVEY, Px4StandIn, line_to, linked, sail, standin

from grebe.core.dynamics import Weather
from grebe.core.errors import LinkError, StoppedError, UsageError
from grebe.core.events import EndReason, Estimate, Step
from grebe.links.base import IDLE, Order
from grebe.links.mavlink.clock import BoatClock
from grebe.links.mavlink.link import open_link
from grebe.links.mavlink.preflight import preflight
from grebe.links.mavlink.rehearsal import RadioFaults
from grebe.links.mavlink.settings import MavlinkSettings
from grebe.simulation.autopilot import Mode, Upsets

AHEAD = Order(thrusts=(5.0, 5.0), surge_mps=1.0, yaw_rate_radps=0.1)


def observe_for_ever(link):
    while True:
        link.observe()


@pytest.mark.parametrize("drive", ["motion", "sticks"])
def test_a_survey_is_sailed_over_the_line(drive):
    boat = standin()
    report, recorder = sail(linked(boat, drive=drive))
    assert report.ended is EndReason.COMPLETE
    assert report.reached == len(SURVEY.targets)
    assert recorder.of(Step)
    assert boat.autopilot.mode is Mode.HOLD


def test_the_estimates_are_the_boat_s_states_in_the_survey_s_frame():
    truth = []
    link = linked(
        standin(**EXACT),
        watch=lambda one: truth.append((one.autopilot.boot_s, *one.autopilot.plant.state)),
    )
    link.command(AHEAD)
    seen = [link.observe() for _ in range(30)][-1]
    assert seen.state[3] > 0.5
    when = seen.time_s - seen.age_s
    near = np.array([row for row in truth if abs(row[0] - when - 38.0) < 20.0])
    nearest = near[np.argmin(np.hypot(*(near[:, 1:3] - seen.state[:2]).T))]
    # The autopilot gives its origin to 1e-7 of a degree, which is a centimetre.
    assert np.array(seen.state) == pytest.approx(nearest[1:], abs=0.01)


def test_the_age_of_an_estimate_is_the_line_s_delay():
    link = linked(radio=RadioFaults(delay_s=0.3))
    ages = [link.observe().age_s for _ in range(20)]
    assert np.median(ages) == pytest.approx(0.3, abs=0.03)
    assert link.station.clock.delay_s == pytest.approx(0.3, abs=0.03)


def test_an_order_is_followed_as_speed_and_yaw_rate():
    boat = standin()
    link = linked(boat)
    for _ in range(60):
        link.observe()
        link.command(AHEAD)
    _, _, _, surge, _, yaw_rate = boat.autopilot.plant.state
    assert surge == pytest.approx(1.0, abs=0.05)
    assert yaw_rate == pytest.approx(0.1, abs=0.02)


def test_thrusts_go_out_as_sticks_that_mix_to_them():
    boat = standin()
    link = linked(boat, drive="sticks")
    link.command(Order(thrusts=(8.0, 3.0), surge_mps=0, yaw_rate_radps=0))
    link.observe()
    link.observe()
    assert boat.autopilot.plant.thrusts == pytest.approx((8.0, 3.0), abs=0.1)


def test_orders_are_repeated_and_end_when_nothing_is_seen_any_more():
    boat = standin()
    silent_from = 48.0
    link = linked(boat, radio=RadioFaults(silence=(silent_from, math.inf)), silence_s=10.0)
    link.command(AHEAD)
    with pytest.raises(LinkError, match="silent for 10 s"):
        observe_for_ever(link)
    assert np.hypot(*boat.autopilot.plant.state[3:5]) < 0.1


@pytest.mark.parametrize("drive", ["motion", "sticks"])
def test_without_orders_the_boat_stops_by_itself(drive):
    boat = standin()
    link = linked(boat, drive=drive)
    link.command(Order(thrusts=(6.0, 6.0), surge_mps=1.2, yaw_rate_radps=0))
    wire = link._wire
    for _ in range(500):
        wire.sail()
    assert abs(boat.autopilot.plant.state[3]) < 0.1


FAULTS = {
    "pilot": (
        Upsets(pilot_takes_at=50.0),
        "the pilot or a fail-safe took over: mode MANUAL",
    ),
    "gps": (Upsets(gps_lost=(50.0, math.inf)), "mode HOLD .*EKF failsafe"),
    "battery": (Upsets(battery_empty_at=50.0), "mode HOLD .*Battery failsafe"),
    "reboot": (Upsets(reboots_at=50.0), "has restarted"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_whoever_takes_the_boat_over_ends_the_mission_with_the_reason(fault):
    faults, reason = FAULTS[fault]
    boat = standin(faults=faults)
    report, _ = sail(linked(boat))
    assert report.ended is EndReason.STOPPED
    assert re.search(reason, report.message), report.message
    if fault == "pilot":
        assert boat.autopilot.mode is Mode.MANUAL, "the mode of the pilot's choice stays"


def test_a_breach_of_the_autopilot_s_own_fence_is_reported():
    small = shapely.Point(*SURVEY.start.at_rest()[:2]).buffer(6.0)
    report, _ = sail(linked(standin(fence=small)))
    assert 'mode HOLD ("Fence breached")' in report.message


def test_a_short_loss_of_the_fix_does_not_end_the_survey():
    report, _ = sail(linked(standin(faults=Upsets(gps_lost=(50.0, 53.0)))))
    assert report.complete


@pytest.mark.parametrize(
    "radio",
    [
        RadioFaults(lost_share=0.3, seed=1),
        RadioFaults(delay_s=0.25, seed=2),
        RadioFaults(jitter_s=0.4, seed=3),
        RadioFaults(silence=(50.0, 54.0)),
    ],
    ids=["lost", "late", "out of order", "silent for 4 s"],
)
def test_a_bad_line_costs_time_and_nothing_else(radio):
    report, recorder = sail(linked(radio=radio))
    assert report.complete
    assert len({step.elapsed_s for step in recorder.of(Step)}) == len(recorder.of(Step))


def test_a_current_is_found_and_made_up_for():
    weather = Weather(current_north_mps=0.25, current_east_mps=-0.2)
    report, _ = sail(linked(standin(weather=weather)))
    assert report.complete


def test_a_boat_that_is_slow_to_start_is_not_taken_for_one_in_a_current():
    """Its autopilot makes whatever surge was predicted, and so would confirm any estimate."""
    report, recorder = sail(linked(standin(accel_max_mps2=0.2)))
    assert report.complete
    found = [event.weather for event in recorder.of(Estimate)]
    assert max(math.hypot(w.current_north_mps, w.current_east_mps) for w in found) < 0.3


def test_nobody_s_yes_arms_nothing():
    boat = standin()
    link = open_link(line_to(boat), SURVEY.frame, SURVEY.vessel)
    asked = []
    with pytest.raises(StoppedError, match="nobody confirmed"):
        link.engage(lambda text: bool(asked.append(text)))
    assert "arms the boat" in asked[0]
    assert not boat.autopilot.armed
    assert boat.autopilot.mode is Mode.HOLD
    link.observe()
    assert boat.autopilot._asked.at_s == -math.inf, "an order went out before anybody agreed"


def test_an_autopilot_that_stays_in_hold_is_reported():
    with pytest.raises(LinkError, match="stays in HOLD and does not enter GUIDED"):
        linked(standin(faults=Upsets(stuck_in_hold=True)))


def test_waiting_for_an_autopilot_without_a_position_ends():
    boat = standin(ready_s=500.0)
    with pytest.raises(LinkError, match="does not know its position yet"):
        open_link(line_to(boat), SURVEY.frame, SURVEY.vessel, MavlinkSettings(settle_s=5.0))


def test_the_error_for_a_silent_line_names_what_to_check():
    with pytest.raises(LinkError, match="No autopilot was heard within 2 s; check the address"):
        open_link(
            line_to(standin(), RadioFaults(silence=(0, math.inf))),
            SURVEY.frame,
            SURVEY.vessel,
            MavlinkSettings(find_s=2.0),
        )


def test_stop_takes_the_thrust_away_and_close_gives_the_boat_back():
    boat = standin()
    link = linked(boat)
    link.command(AHEAD)
    for _ in range(20):
        link.observe()
    link.stop()
    link.observe()
    assert boat.autopilot.mode is Mode.HOLD
    for _ in range(15):
        link.observe()
    assert boat.autopilot.plant.thrusts == (0.0, 0.0)
    assert "HOLD" in link.status().stop_request
    link.close()
    link.close()
    with pytest.raises(LinkError, match="closed"):
        link.observe()


def test_what_the_boat_is_known_as_follows_the_autopilot_s_limits():
    link = linked(standin(speed_max_mps=1.3))
    assert link.model.speed_max_mps == pytest.approx(1.3)
    assert "speed control" in link.model.name
    assert linked(drive="sticks").model is SURVEY.vessel


def test_the_preflight_reads_and_never_writes():
    boat = standin(parameters={"FRAME_CLASS": 1.0, "BATT_FS_LOW_ACT": 0.0, "WP_SPEED": 0.3})
    del boat.parameters["FENCE_ENABLE"]
    before = dict(boat.parameters)
    link = open_link(line_to(boat), SURVEY.frame, SURVEY.vessel)
    lines = {line.what: line for line in preflight(link, SURVEY)}
    assert boat.parameters == before
    for good in ("autopilot", "estimates", "age of an estimate", "clocks", "position", "place"):
        assert lines[good].verdict.value == "ok", lines[good]
        assert not lines[good].advice
    assert lines["parameter WP_SPEED"].verdict.value == "NOT"
    assert lines["parameter FENCE_ENABLE"].found == "not found"
    for doubtful in ("FRAME_CLASS", "BATT_FS_LOW_ACT", "FENCE_ENABLE"):
        assert lines[f"parameter {doubtful}"].verdict.value == "look"
        assert doubtful in lines[f"parameter {doubtful}"].advice


def test_settings_that_cannot_be_are_refused():
    for bad in ({"drive": "sails"}, {"silence_s": 0.0}, {"system": 256}):
        with pytest.raises(UsageError):
            MavlinkSettings(**bad)


@given(
    st.floats(-1e4, 1e4),
    st.lists(st.tuples(st.floats(0.001, 0.2), st.floats(0.0, 0.5)), min_size=5, max_size=30),
)
def test_the_clock_is_off_by_no_more_than_half_its_best_exchange(offset_s, waits):
    """A question and its answer take different times; the truth is in between."""
    clock, now_s = BoatClock(), 100.0
    for there_s, back_s in waits:
        clock.exchanged(now_s, now_s + there_s + back_s, now_s + there_s + offset_s)
        now_s += 1.0
    best_s = min(there_s + back_s for there_s, back_s in waits)
    assert clock.ours(50.0 + offset_s) == pytest.approx(50.0, abs=best_s / 2 + 1e-6)
    assert clock.delay_s == pytest.approx(best_s / 2, abs=1e-6)


def test_a_clock_that_runs_back_is_a_restart_and_a_late_message_is_none():
    clock = BoatClock()
    assert not clock.heard(100.0, 10.0)
    assert not clock.heard(99.5, 10.1)
    assert clock.heard(3.0, 10.2)
    assert not clock.heard(3.1, 10.3)
    assert clock.ours(3.1) == pytest.approx(10.3, abs=0.2)


def test_an_idle_order_asks_for_nothing():
    assert (*IDLE.thrusts, IDLE.surge_mps, IDLE.yaw_rate_radps) == (0.0, 0.0, 0.0, 0.0)


def test_px4_is_switched_to_offboard_only_once_orders_arrive():
    boat = Px4StandIn(standin(**EXACT))
    link = linked(boat)
    assert boat.autopilot.mode is Mode.GUIDED
    assert "PX4" in link.source
    assert link.status().mode == "OFFBOARD"
    assert link.station.parameter("COM_LOW_BAT_ACT") == 2.0
    report, _ = sail(link)
    assert report.complete
    assert boat.refused == 0, "OFFBOARD was asked for before any order"


def test_sticks_need_channels_as_they_are_sent():
    boat = standin(parameters={"RC3_MAX": 2000.0})
    link = open_link(line_to(boat), SURVEY.frame, SURVEY.vessel, MavlinkSettings(drive="sticks"))
    lines = {line.what: line for line in preflight(link, SURVEY)}
    assert lines["parameter RC3_MAX"].verdict.value == "NOT"
    assert lines["parameter RC1_MAX"].verdict.value == "ok"
