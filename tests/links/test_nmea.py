"""NMEA 0183 in, lines of thrust out: the sentences, their times, and the state from them."""

import json
import math
import socket
import threading
from collections import deque
from contextlib import contextmanager

import numpy as np
import pytest
from conftest import FRAME, NOON, square_survey
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.core.errors import GrebeError, LinkError, StoppedError
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import IDLE, Order
from grebe.links.nmea.clock import StreamClock
from grebe.links.nmea.link import NmeaLink, open_nmea
from grebe.links.nmea.navigation import ValueFilter
from grebe.links.nmea.pretend import PLAIN, OutputSettings, PretendBoat, PretendWire, serve
from grebe.links.nmea.sentences import (
    KNOT_MPS,
    Heading,
    NoFix,
    Position,
    Reading,
    TurnRate,
    Variation,
    Velocity,
    read_sentence,
)
from grebe.links.nmea.settings import NmeaSettings, settings_of
from grebe.links.nmea.thrusts import RECEIVER_S, read_thrust_line
from grebe.links.wires import UdpWire
from grebe.mission.departure import prepare
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde
from grebe.workflow.boats import Harbour, boat_named
from grebe.workflow.files import write_survey

BOAT = PRESETS["spyboat"]
FULL = Order(thrusts=(BOAT.thrust_max_n,) * 2, surge_mps=2.0, yaw_rate_radps=0.0)


def sentence(body):
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"${body}*{total:02X}".encode()


def pretend(output=PLAIN, start=(0.0,) * 6, **settings):
    boat = PretendBoat(Plant(BOAT, start), FRAME, UniformSonde(), output)
    wire = PretendWire(boat)
    link = NmeaLink(wire, wire, FRAME, BOAT, NmeaSettings(source="serial:pretend", **settings))
    link.find()
    return boat, link


# Sentences. GGA, RMC and HDT are the printed examples of the standard's users.
def test_printed_sentences_are_read():
    place, motion, variation = read_sentence(
        b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A"
    )
    assert place == Position(
        second_of_day=45_319.0, lonlat=pytest.approx((11 + 31 / 60, 48 + 7.038 / 60))
    )
    course = math.radians(84.4)
    speed = 22.4 * KNOT_MPS
    assert motion.velocity == pytest.approx((speed * math.cos(course), speed * math.sin(course)))
    assert variation == Variation(east_rad=pytest.approx(math.radians(-3.1)))
    (place,) = read_sentence(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47")
    assert (place.fix, place.error_m) == ("GPS", 1.0)
    assert read_sentence(b"$GPHDT,274.07,T*03") == (
        Heading(heading_rad=math.radians(274.07), true=True),
    )


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("HETHS,90.0,A", (Heading(heading_rad=math.pi / 2, true=True),)),
        ("HETHS,90.0,V", ()),
        ("HCHDM,180.0,M", (Heading(heading_rad=math.pi, true=False),)),
        (
            "HCHDG,90.0,0.0,E,180.0,W",
            (Variation(east_rad=-math.pi), Heading(heading_rad=math.pi / 2, true=False)),
        ),
        ("HEROT,-60.0,A", (TurnRate(rate_radps=pytest.approx(math.radians(-1.0))),)),
        ("HEROT,-60.0,V", ()),
        ("GNVTG,90.0,T,,M,1.0,N,1.852,K", (Velocity(velocity=pytest.approx((0.0, KNOT_MPS))),)),
        ("GNVTG,,T,,M,0.1,N,0.2,K", (Velocity(velocity=(0.0, 0.0)),)),
        ("GNVTG,,T,,M,5.0,N,9.3,K", ()),
        ("YXMTW,17.5,C", (Reading(key="temperature_degc", value=17.5),)),
        ("SDDPT,3.2,0.5", (Reading(key="water_depth_m", value=3.7),)),
        ("GPGGA,123519,,,,,0,00,,,M,,M,,", (NoFix(),)),
        ("GPGGA,123519,4807.038,N,01131.000,E,7,08,0.9,5,M,46,M,,", (NoFix(),)),
        ("GPRMC,123519,V,,,,,,,230394,,", (NoFix(),)),
        ("AIHDT,90.0,T", ()),
        ("GPGSV,1,1,01,01,40,083,46", ()),
    ],
)
def test_sentences_become_records(body, said):
    assert read_sentence(sentence(body)) == said


def test_damaged_sentences_give_no_records():
    whole = b"$GPHDT,274.07,T*03"
    for place in range(1, len(whole)):
        for bit in range(7):
            wrong = bytearray(whole)
            wrong[place] ^= 1 << bit
            # Changing a bit in a letter of the sum may leave the sum unchanged: 0a is 0A.
            assert not read_sentence(bytes(wrong)) or bytes(wrong).upper() == whole
    for wrong in (b"", b"$", b"$GPHDT,274.07,T", b"\xff\xfe" * 9, sentence("GPHDT,north,T")):
        assert not read_sentence(wrong)
    for body in (
        "GPHDT,inf,T",
        "GPHDT,nan,T",
        "HEROT,1e999,A",
        "GPHDT,,T",
        "GPRMC,999999,A,4807.038,N,01131.000,E,022.4,084.4,230394,,",
    ):
        assert not read_sentence(sentence(body))
    assert read_sentence(sentence("GPHDT," + 200 * "0" + "9.0,T")) is None


@given(st.binary(max_size=100), st.text("GPRMCHDT,.0159AN", max_size=60))
def test_no_bytes_break_the_reader(data, body):
    read_sentence(data)
    read_sentence(sentence(body))


# Time.
def test_midnight_is_a_step_like_any_other():
    clock = StreamClock()
    times = [clock.at(round(86_399.8 + 0.1 * i, 1) % 86_400, 5.0 + 0.1 * i) for i in range(5)]
    assert times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert clock.jumps == 0


def test_a_sentence_that_was_overtaken_has_no_time():
    clock = StreamClock()
    clock.at(100.0, 0.0)
    clock.at(100.2, 0.2)
    assert clock.at(100.1, 0.21) is None
    assert clock.at(100.2, 0.22) == pytest.approx(0.2)


def test_a_receiver_that_sets_its_clock_does_not_move_ours():
    clock = StreamClock()
    clock.at(0.0, 10.0)
    assert clock.at(40_000.0, 10.1) == pytest.approx(0.1)
    assert clock.at(40_000.1, 10.2) == pytest.approx(0.2)
    assert clock.at(3.0, 10.3) == pytest.approx(0.3)
    assert clock.jumps == 2


def test_a_gap_in_the_sentences_is_one_in_our_time():
    clock = StreamClock()
    clock.at(0.0, 10.0)
    assert clock.at(60.0, 70.0) == 60.0
    assert clock.jumps == 0


def test_what_comes_late_is_that_old():
    clock = StreamClock(late_s=0.2)
    for i in range(10):
        clock.at(100.0 + i, 5.0 + i)
    time_s = clock.at(110.0, 15.3)
    assert clock.now(15.3) - time_s == pytest.approx(0.5, abs=0.01)


# State.
def test_a_track_that_is_measured_exactly_is_followed_and_its_rate_found():
    track = ValueFilter(acceleration=1.0)
    for i in range(200):
        track.measure_value(0.1 * i, 3.0 + 0.7 * 0.1 * i, 0.01)
    assert track.rate == pytest.approx(0.7, abs=1e-6)
    assert track.at(20.0) == pytest.approx(17.0, abs=1e-6)


def test_a_filtered_track_is_nearer_the_truth_than_its_measurements():
    random, track, errors = np.random.default_rng(3), ValueFilter(acceleration=0.3), []
    for i in range(2000):
        truth = math.sin(0.05 * i * 0.1) * 20
        track.measure_value(0.1 * i, truth + random.normal(0, 0.5), 0.5)
        errors.append(track.value - truth)
    assert np.std(errors[100:]) < 0.25


def test_the_state_follows_the_boat():
    boat, link = pretend()
    off = []
    for i in range(200):
        seen = link.observe()
        off.append(np.subtract(seen.state, boat.plant.state))
        acceleration = 0.6 if i % 40 < 20 else 0.3
        thrusts = (acceleration * BOAT.thrust_max_n, 0.4 * BOAT.thrust_max_n)
        link.command(Order(thrusts=thrusts, surge_mps=0.0, yaw_rate_radps=0.0))
    assert abs(boat.plant.state[2]) > 1
    assert np.abs(off).max(axis=0) == pytest.approx(0.0, abs=0.03)


def test_a_magnetic_heading_needs_a_variation_and_yields_to_a_true_one():
    _, link = pretend(OutputSettings(compass="HDM", variation_deg=12.0), (0, 0, 1.0, 0, 0, 0))
    assert link.observe().state[2] == pytest.approx(1.0, abs=0.01)
    _, told = pretend(OutputSettings(compass="HDM"), (0, 0, 1.0, 0, 0, 0), variation_deg=10.0)
    assert told.observe().state[2] == pytest.approx(1.0 + math.radians(10), abs=0.01)


def test_between_rare_positions_headings_make_estimates():
    boat, link = pretend(OutputSettings(place_every=5))
    link.command(FULL)
    seen = [link.observe() for _ in range(60)]
    assert np.diff([one.time_s for one in seen]) == pytest.approx(0.1, abs=0.02)
    assert seen[-1].state == pytest.approx(boat.plant.state, abs=0.2)


def test_noise_is_smoothed_and_its_size_is_not_hidden():
    boat, link = pretend(OutputSettings(position_error_m=0.5, place_every=2))
    off = [np.subtract(link.observe().state, boat.plant.state)[:2] for _ in range(300)]
    assert 0.02 < np.std(off) < 0.5


def test_probes_on_the_line_are_the_sonde():
    _, link = pretend()
    assert link.measure() == {"temperature_degc": 20.0}


# Trouble.
def test_damaged_sentences_are_counted_and_passed_over():
    boat, link = pretend(OutputSettings(damaged_share=0.3))
    link.command(FULL)
    seen = [link.observe() for _ in range(100)]
    assert link.damaged > 50
    assert all(math.isfinite(number) for one in seen for number in one.state)
    assert seen[-1].state == pytest.approx(boat.plant.state, abs=0.3)


def test_without_a_fix_estimates_are_not_numbers_and_the_thrust_goes():
    boat, link = pretend(OutputSettings(no_fix=(5.0, 20.0)))
    seen = []
    while boat.plant.time_s < 25.0:
        link.command(FULL) if boat.plant.time_s < 5.0 else None
        seen.append(link.observe())
    blind = [one.time_s for one in seen if not all(map(math.isfinite, one.state))]
    assert 6.0 < min(blind) < 7.5
    assert max(blind) < 20.5
    assert np.all(np.diff([one.time_s for one in seen]) > 0)
    assert boat.plant.thrusts == (0.0, 0.0)
    assert link.status().fix == "simulated"


def test_a_line_that_falls_silent_is_lost():
    _, link = pretend(OutputSettings(silent=(2.0, 1e9)), silence_s=5.0)
    with pytest.raises(LinkError, match="no sentence came"):
        deque(iter(link.observe, None), maxlen=0)


@pytest.mark.parametrize(
    ("output", "why"),
    [
        (OutputSettings(silent=(0.0, 1e9)), "No NMEA sentence"),
        (OutputSettings(damaged_share=0.999999), "damaged"),
        (OutputSettings(no_fix=(0.0, 1e9)), "no position"),
        (OutputSettings(compass="HDM", no_fix=(0.0, 1e9)), "no position"),
    ],
)
def test_what_is_missing_at_first_is_reported(output, why):
    with pytest.raises(LinkError, match=why):
        pretend(output, find_s=5.0)


def test_a_course_is_no_heading():
    class Headless(PretendBoat):
        def _compass(self):
            return []

    boat = Headless(Plant(BOAT, (0, 0, 0, 1.0, 0, 0)), FRAME)
    wire = PretendWire(boat)
    link = NmeaLink(wire, wire, FRAME, BOAT, NmeaSettings(source="serial:x", find_s=3.0))
    with pytest.raises(LinkError, match="no heading"):
        link.find()


def test_a_mission_that_hangs_leaves_the_boat_without_thrust():
    boat, link = pretend()
    link.command(FULL)
    link.observe()
    boat.advance(RECEIVER_S - 0.2)
    assert boat.plant.thrusts == FULL.thrusts
    boat.advance(0.5)
    assert boat.plant.thrusts == (0.0, 0.0)


# The lines.
def test_a_line_of_thrust_is_as_documented():
    sent = []
    _, link = pretend()
    link._out.send, send = sent.append, link._out.send
    link.command(Order(thrusts=(BOAT.thrust_max_n, -3.0), surge_mps=0, yaw_rate_radps=0))
    link.stop()
    link._out.send = send
    said = json.loads(sent[0])
    assert sent[0].endswith(b"\n")
    assert list(said) == ["t", "port_n", "starboard_n", "port", "starboard", "seq"]
    assert (said["port_n"], said["port"]) == (BOAT.thrust_max_n, 1.0)
    assert (said["starboard_n"], said["starboard"]) == (-3.0, -0.5)
    assert [json.loads(line)["seq"] - said["seq"] for line in sent] == [0, 1]
    assert read_thrust_line(sent[1]).port == 0


def test_a_receiver_refuses_lines_that_are_not_whole():
    for wrong in (
        b"",
        b"{}",
        b"[]",
        b'{"t":1',
        b"\xff",
        b'{"t":1,"port_n":1,"starboard_n":1,"port":NaN,"starboard":1,"seq":1}',
    ):
        assert read_thrust_line(wrong) is None


# The URL.
def test_a_url_is_read():
    assert settings_of("udp:0.0.0.0:10110?out=udp:127.0.0.1:5005&late=0.2") == NmeaSettings(
        source="udp:0.0.0.0:10110", out="udp:127.0.0.1:5005", late_s=0.2
    )
    assert settings_of("serial:/dev/ttyUSB0@38400?variation=-1.5").variation_deg == -1.5


@pytest.mark.parametrize(
    "url",
    [
        "nmea:",
        "nmea:udp:0.0.0.0:10110",
        "nmea:udp:0.0.0.0?out=udp:127.0.0.1:5005",
        "nmea:udp:0.0.0.0:10110?out=tcp:127.0.0.1:5005",
        "nmea:serial:/dev/ttyUSB0@fast",
        "nmea:serial:/dev/ttyUSB0?late=soon",
        "nmea:serial:/dev/ttyUSB0?late=-1",
        "nmea:serial:/dev/ttyUSB0?late=nan",
        "nmea:serial:/dev/ttyUSB0?speed=9",
    ],
)
def test_a_url_that_is_none_is_refused_before_the_mission(url):
    with pytest.raises(GrebeError):
        boat_named(url)


def test_a_serial_line_that_is_not_there_is_named():
    with pytest.raises(LinkError, match="/dev/none"):
        open_nmea(NmeaSettings(source="serial:/dev/none@9600"), FRAME, BOAT)


# All of it, over sockets.
def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextmanager
def over_udp(survey, output):
    """Yield a boat and its URL. The boat keeps step with its helm: its minutes pass as fast as they
    are computed.
    """
    here, there, done = free_port(), free_port(), threading.Event()
    plant = Plant(survey.vessel, survey.start.at_rest())
    boat = PretendBoat(plant, survey.frame, UniformSonde(), output)
    says = UdpWire("127.0.0.1", here, speaks_first=True)
    hears = UdpWire("127.0.0.1", there)
    thread = threading.Thread(target=serve, args=(boat, says, hears, done.is_set, None))
    thread.start()
    try:
        yield boat, f"udp:127.0.0.1:{here}?out=udp:127.0.0.1:{there}"
    finally:
        done.set()
        thread.join()
        says.close()
        hears.close()


def test_a_whole_mission_over_udp_through_midnight():
    survey = square_survey()
    with over_udp(survey, OutputSettings(from_second_of_day=86_397.0)) as (boat, url):
        link = open_nmea(settings_of(url), survey.frame, survey.vessel)
        recorder = MemoryRecorder()
        report = Mission(survey, Controller(survey.vessel, survey.sets), link, recorder).run()
        lines = boat.lines
    assert report.complete
    assert 3.0 < report.duration_s < 30.0
    assert report.samples > 0
    assert lines >= 0.8 * 10 * report.duration_s
    assert boat.plant.thrusts == IDLE.thrusts


def test_nothing_is_sent_to_a_boat_that_nobody_confirms(tmp_path):
    path, survey = tmp_path / "s.gpkg", square_survey()
    write_survey(path, survey)
    with over_udp(survey, PLAIN) as (boat, url), SurveyFile.open(path) as file:
        departure, asked = prepare(file, NOON), []
        harbour = Harbour(confirm=lambda text: bool(asked.append(text)))
        with pytest.raises(StoppedError):
            boat_named(f"nmea:{url}", harbour)(departure)
        assert len(asked) == 1
        assert boat.plant.state == list(survey.start.at_rest())
        link = boat_named(f"nmea:{url}", Harbour(confirm=lambda _: True))(departure)
        assert link.observe().state == pytest.approx(boat.plant.state, abs=0.1)
        link.close()
