"""Boats and helms that break their contract: clocks that stand still, and places and thrusts that
are not numbers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grebe.control.controller import Command, Controller
from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError
from grebe.core.events import Ended, EndReason
from grebe.core.vessel import PRESETS, Vessel
from grebe.links.base import NOT_A_STATE, BoatStatus, Observation, Order
from grebe.links.simulated import SimulatedLink
from grebe.mission.boat_clock import MOST_ALIKE, NEVER_SEEN_S, BoatClock
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.helm import possible_thrusts
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings
from grebe.mission.trial import Conditions, bare_survey, meander, simulate
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

BOAT = PRESETS["spyboat"]
SETS = meander(rows=2, columns=3)
START = (-5.0, 2.0, 0.0, 0.0, 0.0, 0.0)


class Odd(SimulatedLink):
    """A simulated boat whose observations and orders are tampered with."""

    def __init__(self, change: Callable[[int, Observation], Observation]) -> None:
        super().__init__(Plant(BOAT, START), UniformSonde())
        self._change, self._count = change, itertools.count()
        self.orders: list[Order] = []

    def observe(self) -> Observation:
        """See `BoatLink`."""
        return self._change(next(self._count), super().observe())

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        self.orders.append(order)
        super().command(order)


def sailed(link: Odd, helm: Any = None) -> Ended:
    """Return how a mission with such a boat, or helm, ends."""
    recorder = MemoryRecorder()
    helm = helm or Controller(BOAT, SETS)
    settings = MissionSettings(limit_s=300.0)
    Mission(bare_survey(SETS, BOAT), helm, link, recorder, settings).run()
    return recorder.of(Ended)[0]


def test_a_clock_that_stands_ends_the_mission_and_the_thrust() -> None:
    def stands(count: int, seen: Observation) -> Observation:
        return replace(seen, time_s=min(seen.time_s, 3.0))

    link = Odd(stands)
    end = sailed(link)
    assert end.reason is EndReason.LINK_LOST
    assert f"{MOST_ALIKE + 1} estimates in a row" in end.message
    assert link._plant.thrusts == (0.0, 0.0) or link._plant._commanded == (0.0, 0.0)


def test_a_clock_that_runs_back_ends_the_mission() -> None:
    end = sailed(Odd(lambda k, seen: replace(seen, time_s=seen.time_s - 5.0 * (k > 40))))
    assert (end.reason, "went back" in end.message) == (EndReason.LINK_LOST, True)


def test_a_request_to_stop_comes_before_a_clock_error(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Odd(lambda k, seen: replace(seen, time_s=seen.time_s - 5.0 * (k > 40)))
    usual = link.status

    def status() -> BoatStatus:
        asked = "started afresh" if link.orders and next(link._count) > 41 else ""
        return replace(usual(), stop_request=asked)

    monkeypatch.setattr(link, "status", status)
    end = sailed(link)
    assert (end.reason, end.message) == (EndReason.STOPPED, "started afresh")


def test_a_few_estimates_of_one_time_are_a_hiccup() -> None:
    held = [0.0]

    def hiccups(count: int, seen: Observation) -> Observation:
        held[0] = held[0] if count % 30 < 10 else seen.time_s
        return replace(seen, time_s=held[0])

    assert sailed(Odd(hiccups)).reason is EndReason.COMPLETE


def test_a_boat_without_any_position_is_given_up() -> None:
    end = sailed(Odd(lambda _, seen: replace(seen, state=NOT_A_STATE)))
    assert end.reason is EndReason.BLIND
    assert f"within {NEVER_SEEN_S:g} s" in end.message


def test_the_minute_begins_with_the_first_estimate() -> None:
    clock = BoatClock()
    for k in range(10):
        clock.update(Observation(time_s=75.0 + k, state=NOT_A_STATE), had_estimate=False)


@pytest.mark.parametrize("what", ["status", "measure", "command", "close"])
def test_whatever_fails_below_a_link_is_the_link_s(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError("unplugged")

    monkeypatch.setattr(SimulatedLink, what, fails)
    end = sailed(Odd(lambda _, seen: seen))
    assert end.reason is (EndReason.COMPLETE if what == "close" else EndReason.LINK_LOST)


def test_an_os_error_of_a_link_is_a_link_error() -> None:
    def fails(count: int, seen: Observation) -> Observation:
        if count > 20:
            raise OSError("the cable is unplugged")
        return seen

    end = sailed(Odd(fails))
    assert end.reason is EndReason.LINK_LOST
    assert "the cable is unplugged" in end.message


class Helmsman:
    """A helm that always commands the same thrusts."""

    def __init__(self, thrusts: Any, step_s: float = 1.0) -> None:
        self.reached, self.vessel, self.step_s = 0, BOAT, step_s
        self._thrusts = thrusts

    def step(self, *_: object) -> Command:
        """See `Helm`."""
        return Command(thrusts=self._thrusts)


@pytest.mark.parametrize("thrusts", [(math.nan, 1.0), (1.0,), (1.0, 2.0, 3.0), None])
def test_thrusts_that_are_none_are_refused_and_the_boat_is_given_back(thrusts: Any) -> None:
    link = Odd(lambda _, seen: seen)
    with pytest.raises(UsageError, match="thrusts must be"):
        sailed(link, Helmsman(thrusts))
    assert link._plant._commanded == (0.0, 0.0)


@pytest.mark.parametrize("thrusts", [(1e9, -1e9), np.array([1e9, -1e9])])
def test_thrusts_beyond_the_boat_s_are_cut(thrusts: Sequence[float]) -> None:
    link = Odd(lambda _, seen: seen)
    sailed(link, Helmsman(thrusts))
    told = np.array([order.thrusts for order in link.orders])
    assert told.max() <= BOAT.thrust_max_n
    assert told.min() >= BOAT.thrust_min_n
    assert possible_thrusts(BOAT, thrusts) == (BOAT.thrust_max_n, BOAT.thrust_min_n)


@pytest.mark.parametrize("step_s", [math.nan, 0.0, -1.0, math.inf])
def test_a_helm_that_is_never_asked_again_is_refused(step_s: float) -> None:
    with pytest.raises(UsageError, match="step must be above 0"):
        sailed(Odd(lambda _, seen: seen), Helmsman((1.0, 1.0), step_s))


def stiff(**changes: float) -> Vessel:
    """A boat whose yaw decays a hundred times a second."""
    return replace(BOAT, name="stiff", m33_kgm2=0.1, n_r=-10.0, n_rr=0.0, **changes)


def test_a_boat_that_decays_within_the_simulator_s_step_is_followed() -> None:
    plant = Plant(stiff(), START)
    plant.command((5.0, -5.0))
    for _ in range(100):
        plant.advance(0.1)
    turning = 10.0 * BOAT.arm_m / 10.0
    assert plant.state[5] == pytest.approx(turning, rel=1e-3)
    fast = Plant(BOAT, START, Weather(current_north_mps=10.0))
    for _ in range(100):
        fast.advance(0.1)
    assert fast.state[3] == pytest.approx(10.0, rel=0.02)


def test_nothing_to_sail_and_no_place_to_start_from_are_refused() -> None:
    with pytest.raises(UsageError, match="no target set"):
        simulate(BOAT, [], Controller(BOAT, SETS), START)
    with pytest.raises(UsageError, match="six finite numbers"):
        simulate(BOAT, SETS, Controller(BOAT, SETS), (math.nan,) * 6)
    with pytest.raises(UsageError, match="two thrusters"):
        Conditions(effectiveness=(math.nan, 1.0))
