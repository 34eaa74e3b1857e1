"""Instruments over real lines: pseudo-terminals, sockets and files, with faults."""

import socket
import time

import pytest
from conftest import NOON, square_survey

from grebe.control.controller import Controller
from grebe.core.errors import LinkError, UsageError
from grebe.core.events import SampleTaken, Warned
from grebe.core.quantities import BUILTIN
from grebe.links.base import Reading
from grebe.links.checks import Verdict
from grebe.links.instruments import instrument as instrument_module
from grebe.links.instruments.instrument import Instrument, OwnClock
from grebe.links.instruments.pretend import (
    PretendSerial,
    PretendUdp,
    simulated_instrument,
    typical_water,
)
from grebe.links.instruments.profile import profile_named, profile_names
from grebe.links.instruments.sources import open_source
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde
from grebe.workflow.instruments import checks_of, instrument_named, instruments_at, refuse_unopened

# A pseudo-terminal knows no parity: lines are opened as 8N1 here.
STEADY = typical_water(3.0)


def steady(_):
    return STEADY


def wait_for(done, seconds=8.0):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if done():
            return True
        time.sleep(0.02)
    return False


def heard(instrument, count=1):
    got = []
    assert wait_for(lambda: got.extend(instrument.readings()) or len(got) >= count), (
        instrument.state
    )
    return got


@pytest.mark.parametrize("name", profile_names())
def test_every_profile_reads_its_pretend_instrument_over_a_serial_line(name):
    profile = profile_named(name)
    sonde = PretendSerial(simulated_instrument(profile, steady, period_s=0.1))
    instrument = Instrument(f"serial:{sonde.device}:9600:8N1", name, profile, BUILTIN)
    try:
        reading = heard(instrument)[0]
    finally:
        instrument.close()
        sonde.close()
    # A Hyperion measures one thing at a time.
    least = 1 if name == "valeport-hyperion" else len(profile.keys)
    assert len(reading.values) == least
    for key, value in reading.values.items():
        assert value == pytest.approx(STEADY.get(key, 0.0), abs=0.01, rel=1e-3)
    assert 0 <= reading.age_s < 1.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_lines_by_udp_are_read_at_the_instrument_s_own_rate():
    port = free_port()
    instrument = Instrument(
        f"udp:127.0.0.1:{port}", "h", profile_named("valeport-hyperion"), BUILTIN
    )
    sonde = PretendUdp(
        simulated_instrument(instrument.profile, steady, period_s=0.05), f"127.0.0.1:{port}"
    )
    try:
        heard(instrument)
        began = time.monotonic()
        count = len(heard(instrument, 20))
        assert count / (time.monotonic() - began) == pytest.approx(20.0, rel=0.5)
    finally:
        instrument.close()
        sonde.close()


def test_a_logger_s_file_is_read_from_its_end_and_again_when_it_is_restarted(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("1.0\n2.0\n")
    instrument = Instrument(f"file:{path}", "log", profile_named("atlas-ph"), BUILTIN)
    try:
        time.sleep(1.5)
        with path.open("a") as file:
            file.write("7.5\n7.6\n")
        assert [one.values["ph"] for one in heard(instrument, 2)] == [7.5, 7.6]
        path.write_text("8.1\n")
        assert heard(instrument)[0].values["ph"] == 8.1
    finally:
        instrument.close()


def test_a_pulled_cable_is_reported_once_and_a_new_one_is_found(monkeypatch, tmp_path):
    monkeypatch.setattr(instrument_module, "RETRY_S", 0.1)
    monkeypatch.setattr(instrument_module, "LONGEST_RETRY_S", 0.2)
    profile = profile_named("valeport-hyperion")
    cable = tmp_path / "cable"
    first = PretendSerial(simulated_instrument(profile, steady, period_s=0.05))
    cable.symlink_to(first.device)
    instrument = Instrument(f"serial:{cable}:9600:8N1", "h", profile, BUILTIN)
    notes = []
    try:
        heard(instrument)
        first.close()
        cable.unlink()
        assert wait_for(lambda: notes.extend(instrument.notes()) or notes)
        assert not instrument.is_sending
        time.sleep(0.6)
        second = PretendSerial(simulated_instrument(profile, steady, period_s=0.05))
        cable.symlink_to(second.device)
        heard(instrument)
        notes += instrument.notes()
        second.close()
    finally:
        instrument.close()
    assert [code for code, _ in notes] == ["instrument_silent", "instrument_again"]


class Garbling:
    """An instrument whose line is bad: half lines, noise between them, wrong sums."""

    def __init__(self, instrument):
        self.instrument, self.count = instrument, 0

    def receive(self, data):
        answer = self.instrument.receive(data)
        self.count += 1
        return answer[: len(answer) // 2] if self.count % 2 else answer

    def due(self):
        said = self.instrument.due()
        if not said:
            return said
        self.count += 1
        return (said, b"\x00\xff\x93" + said, said[:9], said[:-4] + b"00\r\n")[self.count % 4]


@pytest.mark.parametrize("name", ["ysi-6-series", "insitu-aqua-troll-400"])
def test_a_bad_line_costs_readings_and_never_lets_a_wrong_one_through(name):
    profile = profile_named(name)
    sonde = PretendSerial(Garbling(simulated_instrument(profile, steady, period_s=0.02)))
    instrument = Instrument(f"serial:{sonde.device}:9600:8N1", name, profile, BUILTIN)
    try:
        if name == "ysi-6-series":
            readings = heard(instrument, 5)
        else:
            # Every other answer is cut short, so no complete set of registers comes through.
            assert not wait_for(instrument.readings, 2.0)
            readings = []
    finally:
        instrument.close()
        sonde.close()
    for reading in readings:
        for key, value in reading.values.items():
            assert value == pytest.approx(STEADY[key], abs=0.01)
    assert instrument._source.counts.damaged > 0


class FallingMute:
    """An instrument that falls silent after some answers."""

    def __init__(self, instrument, answers):
        self.instrument, self.left = instrument, answers

    def receive(self, data):
        answer = self.instrument.receive(data)
        self.left -= bool(answer)
        return answer if self.left >= 0 else b""

    def due(self):
        return b""


def test_a_silent_sonde_is_reported_and_asked_again(monkeypatch):
    monkeypatch.setattr(instrument_module, "SILENT_S", 1.0)
    monkeypatch.setattr(instrument_module, "SILENT_PERIODS", 1.0)
    profile = profile_named("aqualabo-c4e")
    mute = FallingMute(simulated_instrument(profile, steady), 4)
    sonde = PretendSerial(mute)
    instrument = Instrument(f"serial:{sonde.device}:9600:8N1", "c4e", profile, BUILTIN)
    notes = []
    try:
        heard(instrument)
        assert wait_for(lambda: notes.extend(instrument.notes()) or notes, 15.0)
        mute.left = 1_000_000
        heard(instrument)
    finally:
        instrument.close()
        sonde.close()
    assert notes[0][0] == "instrument_silent"


def test_an_instrument_s_clock_and_its_jumps_are_followed():
    clock = OwnClock()
    # Stamps are 100 s behind ours; the transfer takes 0.1 s, and now and then 0.5 s.
    ages = [clock.age_s(float(i), i + 100.0 + (0.5 if i % 5 == 3 else 0.1)) for i in range(20)]
    assert max(ages) == pytest.approx(0.4)
    assert ages[-1] == pytest.approx(0.0)
    # The clock is set by an hour.
    assert clock.age_s(3_620.0, 120.1) == 0.0
    assert clock.age_s(3_621.0, 121.3) == pytest.approx(0.2)


class Sondes:
    """Instruments in memory: a reading of another age at every call."""

    keys = ("temperature_degc",)
    silent = ()

    def __init__(self):
        self.calls, self.closed = 0, False

    def readings(self):
        self.calls += 1
        # The newest is last; one is older than the remembered track.
        ages = (1000.0, 0.25, 0.0) if self.calls > 3 else ()
        return [Reading(age_s=age, values={"temperature_degc": 20.0 + age}) for age in ages]

    def notes(self):
        return [("instrument_silent", "the cable")] if self.calls == 5 else []

    def close(self):
        self.closed = True


def test_readings_are_placed_where_the_boat_was_and_kept_out_of_the_sets_too():
    survey = square_survey()
    plant = Plant(survey.vessel, survey.start.at_rest())
    recorder = MemoryRecorder()
    report = Mission(
        survey,
        Controller(survey.vessel, survey.sets, corridors=survey.corridors),
        SimulatedLink(plant, UniformSonde(values={"temperature_degc": 1.0, "ph": 7.0})),
        recorder,
        started=NOON,
        instruments=Sondes(),
    ).run()
    assert report.complete
    samples = [event.sample for event in recorder.of(SampleTaken)]
    apart = [one for one in samples if set(one.values) == {"temperature_degc"}]
    late = [one for one in apart if one.values["temperature_degc"] == 20.25]
    now = [one for one in apart if one.values["temperature_degc"] == 20.0]
    assert len(late) == len(now)
    assert any(one.target_seq is None for one in apart)
    assert any(one.target_seq is not None for one in apart)
    for before, after in zip(late, now, strict=True):
        behind = (after.time - before.time).total_seconds()
        assert behind == pytest.approx(0.25)
        moved = ((after.north_m - before.north_m) ** 2 + (after.east_m - before.east_m) ** 2) ** 0.5
        assert moved <= 0.25 * max(2.0, survey.vessel.speed_max_mps) + 1e-6
    assert [event.code for event in recorder.of(Warned)] == ["instrument_silent"]
    # The boat's own sonde gives nothing that an instrument measures.
    own = [one for one in samples if "ph" in one.values]
    assert own
    assert all("temperature_degc" not in one.values for one in own)


def test_an_instrument_s_address_is_checked():
    with pytest.raises(UsageError, match="ADDRESS@PROFILE"):
        instrument_named("serial:/dev/ttyUSB0")
    instrument = Instrument("carrier:pigeon", "p", profile_named("atlas-ph"), BUILTIN)
    try:
        assert wait_for(lambda: "no instrument line" in instrument.state)
    finally:
        instrument.close()


def test_an_instrument_stands_in_the_preflight_list():
    profile = profile_named("valeport-hyperion")
    sonde = PretendSerial(simulated_instrument(profile, steady, period_s=0.1))
    try:
        line = checks_of(f"serial:{sonde.device}:9600:8N1@valeport-hyperion")
    finally:
        sonde.close()
    assert line.verdict is Verdict.GOOD
    assert "chlorophyll_ugl" in line.found


def test_a_missing_line_is_reported():
    with pytest.raises(LinkError, match="cannot be opened"):
        open_source("serial:/dev/none", profile_named("atlas-ph"), BUILTIN)


def test_a_boat_does_not_set_out_with_a_sonde_that_is_not_there():
    """It once set out, and held its position for ever."""
    with (
        instruments_at(["serial:/dev/nothing-of-that-name@ysi-exo"]) as instrument_sets,
        pytest.raises(LinkError, match="does not answer"),
    ):
        refuse_unopened(instrument_sets.values())
    refuse_unopened([])
