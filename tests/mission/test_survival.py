"""A mission survives being killed, a power cut, the loss of its file, and a wrong clock."""

import json
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from datetime import timedelta
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import NOON, run_simulated, square_survey
from killing import Victim, cut_power, faults, faults_at_the_end, kill

from grebe.cli.main import grebe
from grebe.control.controller import Controller
from grebe.core.errors import LinkError, SurveyFileError
from grebe.core.events import Step, Warned
from grebe.core.samples import Sample
from grebe.io.store import SurveyFile
from grebe.links.base import BoatStatus
from grebe.links.simulated import SimulatedLink
from grebe.mission.departure import prepare
from grebe.mission.events import writer
from grebe.mission.events.broadcast import Broadcast
from grebe.mission.events.recorders import SurveyRecorder
from grebe.mission.events.statistics import Alarm
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde
from grebe.workflow.files import write_survey
from grebe.workflow.preview import preview_of
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld


@pytest.fixture
def planned(tmp_path):
    write_survey(tmp_path / "planned.gpkg", square_survey(side_m=40.0))
    return tmp_path / "planned.gpkg"


@pytest.mark.slow
def test_a_mission_that_is_killed_loses_nothing_and_goes_on_at_the_next_set(tmp_path, planned):
    rng = random.Random(0)
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    victim = Victim.of(here, planned)
    for again in range(3):
        kill(victim, rng.randrange(1, 20), rng.uniform(0, 0.1), *(["--resume"] * (again > 0)))
        assert faults(victim) == []
    with victim.start("--resume") as running:
        victim.wait_for(len(victim.said("step")) + 5, running)
        copy = cut_power(victim, running, there, rng.randbytes(3000))
        running.kill()
        running.communicate()
    victim.kills += 1
    assert faults(copy) == []
    assert faults(victim) == []
    assert faults_at_the_end(victim) == []


def step(i):
    """The i-th second of a boat that drifts north."""
    when = NOON + timedelta(seconds=i)
    state = (float(i), 0.0, 0.0, 1.0, 0.0, 0.0)
    return Step(time=when, elapsed_s=float(i), state=state, thrusts=(1.0, 2.0))


def test_wherever_its_journal_is_cut_off_the_file_holds_what_was_written_first(tmp_path):
    """A power cut may leave any part of the pending writes, but never a gap or damage."""
    rng = random.Random(1)
    path, cut = tmp_path / "s.gpkg", tmp_path / "cut.gpkg"
    with SurveyFile.create(path, square_survey(), meta={}, force=True) as file:
        for i in range(60):
            file.append_track(step(i))
        journal = path.with_name("s.gpkg-wal").read_bytes()
        kept = []
        for size in sorted(rng.randrange(len(journal)) for _ in range(25)):
            shutil.copy(path, cut)
            cut.with_name("cut.gpkg-wal").write_bytes(journal[:size] + rng.randbytes(500))
            with SurveyFile.open(cut) as copy:
                rows = copy.track().states[:, 0].tolist()
            assert rows == list(range(len(rows)))
            kept.append(len(rows))
            for name in ("cut.gpkg-wal", "cut.gpkg-shm"):
                cut.with_name(name).unlink(missing_ok=True)
    assert kept == sorted(kept)
    assert kept[0] < kept[-1]


def test_what_happens_at_one_estimate_is_written_whole_or_not_at_all(tmp_path):
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        recorder = SurveyRecorder(file)
        recorder.record(step(0))
        broken = Warned(time=NOON.replace(tzinfo=None), elapsed_s=1.0, code="x", message="no zone")
        with pytest.raises(ValueError, match="zone"):
            recorder.record_together([step(1), broken])
        recorder.record(step(2))
        assert file.track().states[:, 0].tolist() == [0.0, 2.0]


def test_the_command_is_sent_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "TIMEOUT_S", 60.0)
    happened = []

    def boat_at(departure):
        link = SimulatedWorld()(departure)
        observe, command = link.observe, link.command
        link.observe = lambda: happened.append("in") or observe()
        link.command = lambda order: happened.append("out") or command(order)
        return link

    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        append = file.append_track
        file.append_track = lambda point, boat: happened.append("write") or append(point, boat)
        run_simulated(file, world=boat_at)
    text = " ".join(happened)
    assert "in out write in" in text
    assert "in write" not in text


@pytest.mark.parametrize("fails", [False, True])
def test_the_boat_is_given_back_before_the_end_is_written(fails):
    """The link is closed, not stopped: a pilot who asked for the end may already have the boat."""
    happened = []

    class Pilot(SimulatedLink):
        def status(self):
            return BoatStatus(mode="manual", armed=True, stop_request="the pilot took over")

        def stop(self):
            happened.append("stop")

        def close(self):
            happened.append("close")
            if fails:
                raise LinkError("no answer")

    class Noting:
        def record(self, event):
            happened.append(type(event).__name__)

    survey = square_survey()
    link = Pilot(Plant(survey.vessel, survey.start.at_rest()), UniformSonde())
    mission = Mission(survey, Controller(survey.vessel, survey.sets), link, Noting())
    with pytest.raises(LinkError) if fails else nullcontext():
        mission.run()
    assert "stop" not in happened
    assert happened.index("close") < happened.index("Ended")


class Stuck:
    """A recorder that blocks until it is released, and fails on demand."""

    def __init__(self):
        self.let, self.batches, self.failure = threading.Event(), [], None

    def record(self, event):
        self.record_together([event])

    def record_together(self, events):
        assert self.let.wait(10)
        if self.failure:
            raise self.failure
        self.batches.append(list(events))
        return ()


def test_a_hanging_disk_delays_no_command_and_events_are_published_only_once_stored():
    recorder, heard = Stuck(), []
    broadcast = Broadcast(recorder, [heard.append])
    for i in range(5):
        broadcast.hold(step(i))
        broadcast.release()
    assert heard == recorder.batches == []
    recorder.let.set()
    broadcast.hold(step(5))
    broadcast.close()
    assert heard == [event for batch in recorder.batches for event in batch]
    assert [event.elapsed_s for event in heard] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_failing_disk_ends_the_mission_and_unstored_events_are_not_published():
    recorder, heard = Stuck(), []
    broadcast = Broadcast(recorder, [heard.append])
    recorder.let.set()
    broadcast.hold(step(0))
    broadcast.close()
    recorder.failure = SurveyFileError("full")
    broadcast.hold(step(1))
    with pytest.raises(SurveyFileError, match="full"):
        broadcast.close()
    recorder.failure = None
    broadcast.hold(step(2))
    broadcast.close()
    assert [event.elapsed_s for event in heard] == [0.0, 2.0]


# -- the file is taken away ------------------------------------------------------------------


def other_survey(path):
    SurveyFile.create(path, square_survey(), meta={"survey_id": "other"}, force=True).close()


THEFTS = {
    "deleted": lambda path: path.unlink(),
    "moved": lambda path: path.rename(path.with_name("elsewhere.gpkg")),
    "replaced": lambda path: (
        other_survey(path.with_name("new.gpkg")),
        path.with_name("new.gpkg").replace(path),
    ),
    "its journal deleted": lambda path: path.with_name(path.name + "-wal").unlink(),
}


@pytest.mark.parametrize("theft", THEFTS)
def test_a_removed_file_is_rescued_and_that_is_reported(tmp_path, theft):
    path = tmp_path / "s.gpkg"
    with SurveyFile.create(path, square_survey(), meta={}, force=True) as file:
        file.begin_session(NOON)
        recorder = SurveyRecorder(file)
        assert recorder.record_together([step(0)]) == ()
        THEFTS[theft](path)
        left = path.read_bytes() if path.exists() else None
        (said,) = recorder.record_together([step(1)])
        assert said.code == "file_replaced"
        assert recorder.record_together([step(2)]) == ()
        rescued = file.path
        assert str(rescued) in said.message
        # If the process is killed now, the named file on the disk must have everything.
        shutil.copy(rescued, tmp_path / "copy.gpkg")
        shutil.copy(f"{rescued}-wal", tmp_path / "copy.gpkg-wal")
    for name in (rescued, tmp_path / "copy.gpkg"):
        with SurveyFile.open(name) as again:
            assert again.track().states[:, 0].tolist() == [0.0, 1.0, 2.0]
            assert [event.code for event in again.events()] == ["file_replaced"]
    assert left is None or theft == "its journal deleted" or path.read_bytes() == left


def test_a_mission_whose_file_is_deleted_goes_on_to_its_end(tmp_path):
    path = tmp_path / "s.gpkg"

    def boat_at(departure):
        link = SimulatedWorld()(departure)
        observe = link.observe
        link.observe = lambda: (path.unlink() if departed(link) else None) or observe()
        return link

    def departed(link):
        return path.exists() and link._plant.time_s > 5.0

    with SurveyFile.create(path, square_survey(), meta={}, force=True) as file:
        report = run_simulated(file, world=boat_at)
        assert report.complete
        assert file.path != path
        assert len(file.samples()) == report.samples
        assert file.progress().reached == report.reached


def test_a_link_to_a_file_has_the_same_lock(tmp_path):
    path, link = tmp_path / "s.gpkg", tmp_path / "link.gpkg"
    link.symlink_to(path)
    with SurveyFile.create(path, square_survey(), meta={}, force=True) as first:
        first.claim()
        with SurveyFile.open(link) as second, pytest.raises(SurveyFileError, match="another"):
            second.claim()


# -- the clock -------------------------------------------------------------------------------


def test_a_clock_that_jumps_during_a_mission_does_not_disturb_its_times(tmp_path, monkeypatch):
    jumps = random.Random(2)
    monkeypatch.setattr(time, "time", lambda: jumps.uniform(0, 4e9))
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        report = run_simulated(file)
        times = file.track().times
        assert times[0] == NOON
        assert all(before < after for before, after in pairwise(times))
        assert file.last_time() - NOON == timedelta(seconds=report.duration_s)


YEAR = timedelta(days=365)
CLOCKS = {
    "an hour later": (timedelta(hours=1), ""),
    "a year ahead": (YEAR, "364 days after the recorded mission ended"),
    "before it began": (-timedelta(hours=1), "before the recorded mission ended"),
    "1970": (NOON.replace(year=1970) - NOON, "this computer's clock says 1970-05-01"),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_times_never_run_back_and_a_wrong_clock_is_reported(tmp_path, clock):
    after, says = CLOCKS[clock]
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        for i in range(3):
            file.append_track(step(i))
        departure = prepare(file, NOON + after, resume=True)
        ends = file.track_ends()
        assert departure.started == max(NOON + after, ends[1].time + timedelta(seconds=0.1))
        assert [says in doubt.message for doubt in departure.doubts] == [True] * bool(says)


def test_a_mission_resumed_in_1970_goes_on_in_its_own_time_and_logs_why(tmp_path):
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        run_simulated(file, settings=limited(10.0))
        then = NOON.replace(year=1970)
        report = run_survey(file, SimulatedWorld(), steered_by(), then, resume=True)
        assert report.complete
        assert np.all(np.diff(file.track().seconds) > 0)
        assert [event.code for event in file.events()].count("clock_doubtful") == 1


def test_a_mission_goes_on_after_the_last_sample_though_the_track_ends_before(tmp_path):
    late = Sample(
        time=NOON + timedelta(seconds=2.4),
        north_m=2.0,
        east_m=0.0,
        target_seq=None,
        speed_mps=1.0,
        values={"ph": 7.0},
        flags={},
    )
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta={}, force=True) as file:
        file.append_track(step(2))
        file.append_samples([late])
        departure = prepare(file, NOON, resume=True)
        assert departure.started == late.time + timedelta(seconds=0.1)


def test_a_clock_before_the_plan_was_made_is_reported(tmp_path):
    meta = {"created": "2026-05-01T12:00:00.000Z"}
    with SurveyFile.create(tmp_path / "s.gpkg", square_survey(), meta=meta, force=True) as file:
        assert prepare(file, NOON).doubts == ()
        (doubt,) = prepare(file, NOON - YEAR).doubts
        assert "before this plan was made" in doubt.message


# -- another machine -------------------------------------------------------------------------


def test_a_copy_without_its_journal_is_known_for_one(tmp_path):
    path, copy = tmp_path / "s.gpkg", tmp_path / "copy" / "s.gpkg"
    copy.parent.mkdir()
    with SurveyFile.create(path, square_survey(), meta={}, force=True) as file:
        file.append_track(step(0))
        file.begin_session(NOON)
        file.append_track(step(1))
        shutil.copy(path, copy)
    with SurveyFile.open(copy) as alone:
        (doubt,) = prepare(alone, NOON, resume=True).doubts
        assert "s.gpkg-wal" in doubt.message
        assert "after 2026-05-01 12:00:00 UTC may be lost" in doubt.message
    with SurveyFile.open(path) as closed:
        assert prepare(closed, NOON, resume=True).doubts == ()
        assert "mission_open" not in closed.meta()


def test_a_file_whose_journal_a_reader_has_folded_in_is_known_for_whole(tmp_path):
    """A mission is killed, a reader opens its file, and the mission resumes: nothing is missing."""
    path, dead = tmp_path / "s.gpkg", tmp_path / "dead" / "s.gpkg"
    dead.parent.mkdir()
    with SurveyFile.create(path, square_survey(), meta={}, force=True) as file:
        file.append_track(step(0))
        file.begin_session(NOON)
        file.append_track(step(1))
        for name in ("s.gpkg", "s.gpkg-wal"):
            shutil.copy(path.with_name(name), dead.with_name(name))
        # While a mission writes, a reader writes nothing down.
        with SurveyFile.open(path):
            pass
        assert "mission_open" in file.meta()
    with SurveyFile.open(dead) as looked_at:
        assert len(looked_at.track()) == 2
    assert not dead.with_name("s.gpkg-wal").exists()
    with SurveyFile.open(dead) as resumed:
        assert prepare(resumed, NOON, resume=True).doubts == ()


def test_a_preview_says_what_resuming_then_does_and_changes_nothing(tmp_path):
    path = tmp_path / "s.gpkg"
    with SurveyFile.create(path, square_survey(side_m=30.0), meta={}, force=True) as file:
        whole = preview_of(prepare(file, NOON))
        assert (whole.reached, whole.next_target, whole.forgets) == (0, 1, False)
        report = run_simulated(file, settings=limited(15.0))
    before = path.read_bytes()
    with SurveyFile.open(path) as file:
        preview = preview_of(prepare(file, NOON, resume=True))
    assert path.read_bytes() == before
    assert 0 < preview.reached == report.reached < 9
    assert preview.next_target == report.reached + 1
    assert preview.remaining_s < whole.remaining_s
    with SurveyFile.open(path) as file:
        departure = prepare(file, NOON, resume=True)
        target = file.survey.targets[preview.next_target - 1].set
        away = target.footprint_distance(*departure.state[:2])
        assert preview.distance_m == pytest.approx(away, abs=0.05)
        rest = run_simulated(file, resume=True)
        assert rest.complete
        assert preview.remaining_s == pytest.approx(rest.duration_s, rel=0.5)
        done = preview_of(prepare(file, NOON, resume=True))
    assert (done.next_target, done.remaining_s, done.distance_m) == (None, 0.0, 0.0)


def test_the_command_line_previews(tmp_path, planned):
    done = CliRunner().invoke(grebe, ["run", str(planned), "--preview", "--json"])
    assert done.exit_code == 0, done.output
    preview = json.loads(done.stdout)
    assert (preview["reached"], preview["next_target"]) == (0, 1)
    assert preview["remaining_s"] > 10
    with SurveyFile.open(planned) as file:
        assert "run" not in file.meta()


def test_an_operator_hears_of_a_warning_once_in_a_while():
    said = []
    alarm = Alarm(said.append)
    for i in range(100):
        alarm(step(i))
        alarm(Warned(time=NOON, elapsed_s=float(i), code="blind", message=f"at {i}"))
    assert said == [f"warning: at {i}" for i in (0, 30, 60, 90)]


def limited(seconds):
    return MissionSettings(limit_s=seconds)


# -- nobody steers -----------------------------------------------------------------------------

HALT = """
def halt(log):
    with open(log, "a") as file:
        file.write("halted\\n")
"""
GUARDED = """
from grebe.links.emergency import EmergencyStop

Boat.emergency = EmergencyStop(action={halt!r} + ":halt", settings={{"log": {log!r}}})
"""


@pytest.mark.slow
def test_a_boat_whose_mission_is_killed_is_stopped_and_the_next_run_reports_it(tmp_path, planned):
    victim, log, halt = Victim.of(tmp_path, planned), tmp_path / "log", tmp_path / "halt.py"
    halt.write_text(HALT)
    guard = GUARDED.format(halt=str(halt), log=str(log))
    victim.boat.write_text(victim.boat.read_text() + guard)
    kill(victim, 5, 0.0)
    while not log.exists():
        time.sleep(0.02)
    assert faults(victim) == []
    assert faults_at_the_end(victim) == []
    assert log.read_text() == "halted\n"
    with SurveyFile.open(victim.path) as file:
        (told,) = [event.message for event in file.events() if event.code == "watchdog_acted"]
    assert "the boat was stopped" in told


# -- who watches -----------------------------------------------------------------------------

# Each progress message is longer than any pipe holds, and nobody reads it.
WATCHED = """
import sys
from grebe.cli import output
from grebe.cli.main import main

update = output.MissionBar.update

def talk(self, progress):
    output.note("x" * 10_000)
    update(self, progress)

output.MissionBar.update = talk
sys.argv = ["grebe", "run", {path!r}, "--link", "python:" + {boat!r}]
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", ["a pipe that nobody reads", "a terminal that closes"])
def test_a_mission_does_not_depend_on_who_watches(tmp_path, planned, how):
    victim = Victim.of(tmp_path, planned, pace_s=0.0)
    code = WATCHED.format(path=str(victim.path), boat=str(victim.boat))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        victim.wait_for(3, running)
        if how == "a terminal that closes":
            running.stderr.close()
            running.send_signal(signal.SIGHUP)
        out = running.stdout.read()
        assert running.wait() == 0
    assert "mission_complete" in out
