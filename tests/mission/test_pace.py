"""A sortie is late if its time, or its battery at the power drawn, does not last."""

from types import SimpleNamespace

import pytest

from grebe.core.plan_settings import SortieSettings
from grebe.core.vessel import PRESETS
from grebe.mission import pace
from grebe.mission.pace import LEAST_S, Pace

HOME = ((8.0, 47.0),)


def delay(bounds, used_wh, monkeypatch, *, slower=1.5, half_s=600.0):
    """How late a sortie of two equal halves is after the first, sailed `slower` than predicted."""
    monkeypatch.setattr(pace, "remaining_s", lambda *_: half_s)
    part = SimpleNamespace(settings=None, targets=[1, 2])
    watch = Pace(vessel=PRESETS["blueboat"], bounds=bounds)
    assert watch.delay(0.0, 0, (0.0, 0.0), part, 0.0) is None
    return watch.delay(slower * half_s, 1, (50.0, 0.0), part, used_wh)


def test_a_boat_that_is_slow_to_save_its_battery_puts_nothing_off(monkeypatch):
    """It takes half as long again as predicted, at a third of the power."""
    bounds = SortieSettings(battery_wh=100.0, reserve=0.2, harbours=HOME)
    assert delay(bounds, 20.0, monkeypatch) is None


def test_a_battery_that_does_not_last_at_the_power_drawn_is_late(monkeypatch):
    bounds = SortieSettings(battery_wh=100.0, reserve=0.2, harbours=HOME)
    told = delay(bounds, 50.0, monkeypatch)
    assert told.pace == pytest.approx(1.5)
    # Without the reserve 30 Wh are left, at 50 Wh in 900 s.
    assert told.left_s == pytest.approx(540.0)


def test_minutes_are_minutes_whatever_the_battery_has(monkeypatch):
    bounds = SortieSettings(minutes=25.0, reserve=0.2, harbours=HOME)
    told = delay(bounds, 1.0, monkeypatch)
    assert told.left_s == pytest.approx(0.8 * 1500 - 900)


def test_a_short_time_gives_no_pace(monkeypatch):
    bounds = SortieSettings(minutes=1.0, reserve=0.2, harbours=HOME)
    assert delay(bounds, 1.0, monkeypatch, slower=1.0, half_s=0.9 * LEAST_S) is None
