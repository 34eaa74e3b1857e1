"""The contract of every boat link; add your own link to `LINKS` to test it too."""

import json
import math
import socket
import threading

import numpy as np
import pytest
from conftest import square_survey
from links.boats import EXACT, linked, standin

from grebe.control.controller import Controller
from grebe.core.dynamics import CALM
from grebe.core.errors import LinkError
from grebe.core.inner_loop import held_motion
from grebe.core.quantities import LIMNOLOGICAL
from grebe.links.base import IDLE, BoatStatus, Observation, Order
from grebe.links.nmea.link import NmeaLink
from grebe.links.nmea.pretend import PretendBoat, PretendWire
from grebe.links.nmea.settings import NmeaSettings
from grebe.links.recording import RecordingLink
from grebe.links.replay import Recording, ReplayLink
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.mission.round_robin import RoundRobin, RoundRobinLink
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import Sonde, UniformSonde
from grebe.simulation.water import free_water

SURVEY = square_survey()
BOAT = SURVEY.vessel


def order(port_n, starboard_n, state=(0.0,) * 6):
    """The order that the mission would give at a state."""
    thrusts = (port_n, starboard_n)
    surge, yaw_rate = held_motion(BOAT, state, thrusts, CALM)
    return Order(thrusts=thrusts, surge_mps=surge, yaw_rate_radps=yaw_rate)


def simulated(kind=SimulatedLink):
    sonde = Sonde(free_water(SURVEY.water.bounds, 1), 1)
    return kind(Plant(BOAT, SURVEY.start.at_rest()), sonde)


class Wrapping(SimulatedLink):
    """A link whose compass reports headings from -pi to pi, as most do."""

    def _estimate(self):
        north, east, heading, *rest = super()._estimate()
        return (north, east, math.remainder(heading, 2 * math.pi), *rest)


class OverSocket:
    """A boat at the other end of a socket: a link that a user would write for another protocol."""

    source = "a boat behind a socket"

    def __init__(self):
        here, there = socket.socketpair()
        self._file = here.makefile("rw")
        self._socket, self._open = here, True
        threading.Thread(target=_serve, args=(simulated(), there), daemon=True).start()

    def _ask(self, **question):
        if not self._open:
            raise LinkError("The socket is closed.")
        print(json.dumps(question), file=self._file, flush=True)
        return json.loads(self._file.readline())

    def observe(self):
        answer = self._ask(ask="observe")
        return Observation(time_s=answer["time_s"], state=tuple(answer["state"]))

    def command(self, order):
        self._ask(ask="command", throttles=[BOAT.throttle_of(one) for one in order.thrusts])

    def measure(self):
        return self._ask(ask="measure")

    def status(self):
        return BoatStatus(mode="socket", armed=self._open)

    def stop(self):
        self.command(IDLE)

    def close(self):
        if self._open:
            self.stop()
            self._open = False
            self._socket.close()


def _serve(link, there):
    with there, there.makefile("rw") as file:
        for line in file:
            question, answer = json.loads(line), {}
            if question["ask"] == "observe":
                seen = link.observe()
                answer = {"time_s": seen.time_s, "state": seen.state}
            elif question["ask"] == "measure":
                answer = dict(link.measure())
            else:
                link.command(order(*map(BOAT.thrust_of, question["throttles"])))
            print(json.dumps(answer), file=file, flush=True)


def nmea():
    boat = PretendBoat(Plant(BOAT, SURVEY.start.at_rest()), SURVEY.frame, UniformSonde())
    wire = PretendWire(boat)
    link = NmeaLink(wire, wire, SURVEY.frame, BOAT, NmeaSettings(source="serial:pretend"))
    link.find()
    return link


def replayed():
    seconds = np.arange(0.0, 30.0, 0.1)
    states = np.zeros((len(seconds), 6))
    states[:, 3], states[:, 0] = 1.0, seconds
    readings = [(float(second), {"ph": 7.0}) for second in range(30)]
    return ReplayLink(Recording(name="lake", seconds=seconds, states=states, readings=readings))


class Deaf:
    """A recorder of a drive that stores nothing."""

    def state(self, time_s, state):
        pass

    def order(self, time_s, order):
        pass


LINKS = {
    "simulated": simulated,
    "wrapping": lambda: simulated(Wrapping),
    "socket": OverSocket,
    "mavlink, by motion": lambda: linked(standin(SURVEY, **EXACT), survey=SURVEY),
    "mavlink, by sticks": lambda: linked(standin(SURVEY, **EXACT), survey=SURVEY, drive="sticks"),
    "nmea": nmea,
    "recorded": lambda: RecordingLink(simulated(), Deaf()),
    "in turn": lambda: RoundRobinLink(simulated(), RoundRobin([1]), 1),
}
# Boats that follow thrusts without lag: a mission is the same on all of them.
BARE = ("simulated", "wrapping", "socket")
# A replay follows its recording, whatever it is ordered.
ALL = LINKS | {"replay": replayed}


@pytest.fixture(params=ALL)
def link(request):
    opened = ALL[request.param]()
    yield opened
    opened.close()


@pytest.fixture(params=LINKS)
def steered(request):
    opened = LINKS[request.param]()
    yield opened
    opened.close()


def test_time_goes_on_and_states_are_six_numbers(link):
    seen = [link.observe() for _ in range(20)]
    assert all(len(one.state) == 6 and all(map(math.isfinite, one.state)) for one in seen)
    assert np.all(np.diff([one.time_s for one in seen]) > 0)


def test_thrust_ahead_moves_the_boat_ahead_and_port_thrust_turns_it_to_starboard(steered):
    before = steered.observe().state
    steered.command(order(0.8 * BOAT.thrust_max_n, 0.4 * BOAT.thrust_max_n, before))
    after = [steered.observe() for _ in range(20)][-1].state
    ahead = np.dot(np.subtract(after[:2], before[:2]), (math.cos(before[2]), math.sin(before[2])))
    assert ahead > 0
    assert after[3] > 0
    assert after[5] > 0


def test_thrusts_hold_until_the_next_command_and_stop_takes_them_away(steered):
    steered.observe()
    steered.command(order(BOAT.thrust_max_n, BOAT.thrust_max_n))
    speeds = [steered.observe().state[3] for _ in range(30)]
    assert np.all(np.diff(speeds) > 0)
    steered.stop()
    later = [steered.observe().state[3] for _ in range(100)]
    assert later[-1] < 0.2 * speeds[-1]


def test_readings_are_of_known_quantities(link):
    link.observe()
    reading = link.measure()
    assert set(reading) <= set(LIMNOLOGICAL)
    assert all(map(math.isfinite, reading.values()))


def test_the_status_and_the_source_can_be_read_at_once(link):
    status = link.status()
    assert isinstance(status, BoatStatus)
    assert status.mode
    assert not status.stop_request
    assert link.source


def test_a_closed_link_has_no_estimates_and_may_be_closed_again(link):
    link.observe()
    link.close()
    with pytest.raises(LinkError):
        link.observe()
    link.close()


def test_every_link_gives_the_same_mission_whatever_turn_its_compass_is_in():
    tracks = []
    for name in BARE:
        recorder = MemoryRecorder()
        report = Mission(SURVEY, Controller(BOAT, SURVEY.sets), LINKS[name](), recorder).run()
        assert report.complete
        tracks.append((report.duration_s, report.path_m, report.steps))
    assert tracks[0] == tracks[1]
    assert tracks[2] == pytest.approx(tracks[0], rel=1e-3)


def test_a_link_that_estimates_gives_nearly_the_same_mission():
    exact, estimated = (
        Mission(SURVEY, Controller(BOAT, SURVEY.sets), make(), MemoryRecorder()).run()
        for make in (simulated, nmea)
    )
    assert estimated.complete
    assert estimated.duration_s == pytest.approx(exact.duration_s, rel=0.05)
    assert estimated.path_m == pytest.approx(exact.path_m, rel=0.05)
