"""A watchdog stops a boat whose mission has died or hangs, and no other boat."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import NOON, run_simulated, square_survey

from grebe.core.dynamics import CALM
from grebe.core.errors import LinkError
from grebe.core.events import Estimate, Step
from grebe.io.store import SurveyFile
from grebe.links.base import AsDriven, as_driven
from grebe.links.emergency import EmergencyStop, emergency_of
from grebe.links.forwarding import ForwardingLink
from grebe.mission.safety.watchdog import Watchdog, journal_beside, taken_notes
from grebe.workflow.simulated import SimulatedWorld

# A boat that writes a line to a file when it is stopped from outside.
BOAT = """
import sys

def stop(file, word="stopped"):
    with open(file, "a") as log:
        print(word, "numpy" in sys.modules, file=log)

def reluctant(file):
    tried = open(file, "a")
    print("tried", file=tried)
    if tried.tell() < 12:
        raise OSError("no answer")
"""
# A mission that gives signs of life until something happens to it.
MISSION = """
import json, sys, time
from datetime import UTC, datetime
from pathlib import Path
from grebe.core.events import Step
from grebe.links.emergency import EmergencyStop
from grebe.mission.safety.watchdog import Watchdog
told = json.loads(sys.argv[1])
dog = Watchdog(EmergencyStop(**told["stop"]), Path(told["journal"]))
step = Step(time=datetime.now(UTC), elapsed_s=0.0, state=(0.0,) * 6, thrusts=(1.0, 1.0))
dog(step)
print(dog.pid, flush=True)
while True:
    dog(step)
    time.sleep(0.02)
"""


@pytest.fixture
def boat(tmp_path):
    (tmp_path / "boat.py").write_text(BOAT)
    return tmp_path


def stop_of(boat, function="stop", patience_s=0.5):
    file = str(boat / "log")
    return {
        "action": f"{boat / 'boat.py'}:{function}",
        "settings": {"file": file},
        "patience_s": patience_s,
    }


ORDER = Step(time=NOON, elapsed_s=0.0, state=(0.0,) * 6, thrusts=(1.0, 1.0))
ESTIMATE = Estimate(time=NOON, elapsed_s=0.0, state=(0.0,) * 6, weather=CALM)


def under_orders(boat, function="stop", patience_s=5.0):
    """A watchdog of a boat that has had its first command."""
    dog = Watchdog(EmergencyStop(**stop_of(boat, function, patience_s)))
    dog(ORDER)
    return dog


def log(boat):
    file = boat / "log"
    return file.read_text().splitlines() if file.exists() else []


def until(true, limit_s=20.0):
    for _ in range(int(limit_s / 0.02)):
        if true():
            return
        time.sleep(0.02)
    raise AssertionError("it did not come to that")


@pytest.fixture
def mission(boat):
    told = json.dumps({"stop": stop_of(boat), "journal": str(boat / "journal")})
    with subprocess.Popen(
        [sys.executable, "-c", MISSION, told], stdout=subprocess.PIPE, text=True
    ) as process:
        watcher = int(process.stdout.readline())
        yield process, watcher
        process.kill()


def test_a_mission_that_is_killed_leaves_a_stopped_boat(boat, mission):
    process, watcher = mission
    assert log(boat) == []
    process.kill()
    process.wait()
    until(lambda: log(boat))
    assert log(boat) == ["stopped False"]
    until((boat / "journal").exists)
    (note,) = taken_notes(boat / "journal")
    assert "ended without signing off; the boat was stopped" in note
    until(lambda: not Path(f"/proc/{watcher}").exists())
    assert taken_notes(boat / "journal") == []


def test_a_mission_that_hangs_leaves_a_stopped_boat_and_is_watched_on(boat, mission):
    process, _ = mission
    process.send_signal(signal.SIGSTOP)
    until(lambda: len(log(boat)) == 1)
    process.send_signal(signal.SIGCONT)
    time.sleep(0.3)
    process.send_signal(signal.SIGSTOP)
    until(lambda: len(log(boat)) == 2)
    process.kill()
    assert all("no sign of life" in note for note in taken_notes(boat / "journal"))


def test_a_signal_to_the_mission_s_group_does_not_reach_the_watchdog(boat, mission):
    process, watcher = mission
    assert os.getpgid(watcher) != os.getpgid(process.pid)
    assert os.getsid(watcher) != os.getsid(process.pid)


def test_a_watchdog_is_small(mission):
    _, watcher = mission
    status = Path(f"/proc/{watcher}/status").read_text()
    resident = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    assert int(resident.split()[1]) < 20_000  # kB


def test_a_stop_that_fails_is_tried_again(boat):
    with pytest.raises(ZeroDivisionError), under_orders(boat, "reluctant"):
        raise ZeroDivisionError
    assert log(boat) == ["tried", "tried"]


def test_an_unforeseen_end_is_no_goodbye_and_a_foreseen_one_is(boat):
    with under_orders(boat):
        pass
    with pytest.raises(KeyboardInterrupt), under_orders(boat):
        raise KeyboardInterrupt
    assert log(boat) == []
    with pytest.raises(LinkError), under_orders(boat):
        raise LinkError("the link could not be closed")
    assert log(boat) == ["stopped False"]


def test_a_boat_without_orders_so_far_is_not_stopped(boat):
    """The first step may take long; until then the boat belongs to whoever holds it."""
    dog = Watchdog(EmergencyStop(**stop_of(boat, patience_s=0.05)))
    dog(ESTIMATE)
    time.sleep(0.3)
    dog.desert()
    assert log(boat) == []


@pytest.mark.parametrize(
    ("action", "says"),
    [
        ("no_such_module:stop", "ModuleNotFoundError"),
        ("grebe.links.watchdog_process:sail", "AttributeError"),
    ],
)
def test_a_boat_that_nobody_could_stop_is_not_set_out_with(action, says):
    with pytest.raises(LinkError, match=says):
        Watchdog(EmergencyStop(action=action))


@pytest.mark.parametrize(
    "wrong", [{"action": "stop"}, {"action": "a:b", "patience_s": 0}, {"settings": {"x": object()}}]
)
def test_an_emergency_stop_is_checked_when_it_is_made(wrong):
    with pytest.raises(LinkError):
        EmergencyStop(**({"action": "a:b"} | wrong))


def test_a_watchdog_that_is_dead_disturbs_no_mission(boat):
    with under_orders(boat) as dog:
        os.kill(dog.pid, signal.SIGKILL)
        until(lambda: not dog.is_there)
        for _ in range(100_000):
            dog(ESTIMATE)


def test_the_watchdog_s_action_is_reported_by_the_next_mission(boat):
    def boat_at(departure):
        link = SimulatedWorld()(departure)
        link.emergency = EmergencyStop(**stop_of(boat, patience_s=10.0))
        return link

    with SurveyFile.create(boat / "s.gpkg", square_survey(), meta={}, force=True) as file:
        journal_beside(file.path).write_text("0 the mission was dead; the boat was stopped\n")
        assert run_simulated(file, world=boat_at).complete
        warned = [event for event in file.events() if event.code == "watchdog_acted"]
        assert [event.time for event in warned] == [NOON]
        assert "1970-01-01 00:00:00 UTC: the mission was dead" in warned[0].message
    assert log(boat) == []


def test_what_was_recorded_is_kept_where_the_watchdog_does_not_start(boat):
    """A mission is deleted only once everything that the new one needs is there."""
    closed = []

    def boat_at(departure):
        link = SimulatedWorld()(departure)
        link.emergency = EmergencyStop(action="no_such_module:stop")
        close = link.close
        link.close = lambda: (closed.append(True), close())
        return link

    with SurveyFile.create(boat / "s.gpkg", square_survey(), meta={}, force=True) as file:
        run_simulated(file)
        before = file.count("samples"), len(file.track())
        with pytest.raises(LinkError):
            run_simulated(file, world=boat_at, force=True)
        assert (file.count("samples"), len(file.track())) == before
    assert closed


def test_a_link_that_wraps_another_passes_on_how_its_boat_is_driven_and_stopped():
    class Autopilot:
        as_driven = AsDriven(holds_motion=True, braking_share=0.4)
        emergency = EmergencyStop(action="boat:stop")

    wrapped = ForwardingLink(Autopilot())
    assert as_driven(wrapped) == Autopilot.as_driven
    assert emergency_of(wrapped) == Autopilot.emergency
    assert emergency_of(ForwardingLink(object())) is None
    assert as_driven(ForwardingLink(object())) == AsDriven()
