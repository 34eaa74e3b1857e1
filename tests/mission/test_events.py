"""The events of a mission, and their receivers."""

import itertools
import math
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from conftest import NOON, run_simulated, square_survey

from grebe.control.controller import Controller
from grebe.core.errors import StoppedError, UsageError
from grebe.core.events import (
    Ended,
    EndReason,
    Estimate,
    Prediction,
    Reached,
    Revised,
    SampleTaken,
    Started,
    Step,
    log_entry,
)
from grebe.io.store import SurveyFile
from grebe.links.base import BoatStatus
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.broadcast import Broadcast
from grebe.mission.events.recorders import MemoryRecorder, SurveyRecorder
from grebe.mission.events.statistics import ProgressMeter
from grebe.mission.loop import Mission
from grebe.mission.measuring.sampling import InSets, InWindow
from grebe.mission.settings import MissionSettings
from grebe.mission.trial import Conditions, meander, simulate
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

SURVEY = square_survey(side_m=30.0)


def boat(kind=SimulatedLink):
    return kind(Plant(SURVEY.vessel, SURVEY.start.at_rest()), UniformSonde())


def mission(recorder, link=None, **how):
    helm = Controller(SURVEY.vessel, SURVEY.sets)
    return Mission(SURVEY, helm, link or boat(), recorder, started=NOON, **how)


@pytest.fixture(scope="module")
def heard():
    recorder = MemoryRecorder()
    report = mission(recorder).run()
    assert report.complete
    return recorder, report


def test_a_mission_begins_once_and_ends_once_with_a_reason(heard):
    recorder, report = heard
    assert isinstance(recorder.events[0], Started)
    assert isinstance(recorder.events[-1], Ended)
    assert recorder.events[-1].reason is report.ended is EndReason.COMPLETE
    assert len(recorder.of(Started)) == len(recorder.of(Ended)) == 1


def test_events_come_in_the_order_of_time_and_carry_utc(heard):
    recorder, _ = heard
    elapsed = [event.elapsed_s for event in recorder.events]
    assert elapsed == sorted(elapsed)
    for event in recorder.events:
        assert event.time == NOON + timedelta(seconds=event.elapsed_s)


def test_every_target_is_reached_once_in_its_order(heard):
    recorder, _ = heard
    assert [event.target_seq for event in recorder.of(Reached)] == list(range(1, 10))
    assert [event.count for event in recorder.of(Reached)] == list(range(1, 10))


def test_each_control_step_publishes_its_horizon(heard):
    recorder, report = heard
    predictions = recorder.of(Prediction)
    steps = [step for step in recorder.of(Step) if step.solve_ms is not None]
    assert len(predictions) == len(steps) == report.steps
    for step, ahead in zip(steps, predictions, strict=True):
        assert ahead.states[0] == pytest.approx(step.state)
        assert len(ahead.after_s) == len(ahead.states) == len(ahead.thrusts) + 1
        assert tuple(ahead.thrusts[0]) == pytest.approx(step.thrusts)


def test_the_report_counts_the_events(heard):
    recorder, report = heard
    taken = recorder.of(SampleTaken)
    assert report.samples == len(taken)
    assert report.samples_in_sets == sum(one.sample.target_seq is not None for one in taken)
    places = np.array([event.state[:2] for event in recorder.of(Estimate)])
    assert report.path_m == pytest.approx(np.hypot(*np.diff(places, axis=0).T).sum(), abs=0.01)


def test_by_default_every_second_within_the_window_is_kept(heard):
    """A reading is missing only when the surge is outside the window."""
    recorder, _ = heard
    when = np.array([event.elapsed_s for event in recorder.of(SampleTaken)])
    window = SURVEY.sets[0]
    slow = [e.elapsed_s for e in recorder.of(Estimate) if not window.allows(e.state[3])]
    for a, b in itertools.pairwise(when):
        assert b - a <= 1.0 + 1e-6 or any(a < t <= b for t in slow)


def test_readings_in_sets_alone_are_a_part_of_those_in_the_window():
    apart, kept = meander(rows=1, columns=9)[::2], {}
    for sampling in (InWindow(), InSets()):
        helm = Controller(SURVEY.vessel, apart)
        world = Conditions(sampling=sampling)
        trial = simulate(SURVEY.vessel, apart, helm, (-5.0, 2.0, 0, 0, 0, 0), world)
        kept[sampling] = [one.sample.target_seq for one in trial.recorder.of(SampleTaken)]
    assert None not in kept[InSets()]
    assert None in kept[InWindow()]
    assert set(kept[InSets()]) == {1, 2, 3, 4, 5} == set(kept[InWindow()]) - {None}


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan])
def test_a_sampling_period_must_be_positive(period_s):
    with pytest.raises(UsageError):
        InWindow(period_s=period_s)


def test_the_operator_s_stop_is_an_event_with_a_reason_in_the_file_too(tmp_path):
    with SurveyFile.create(tmp_path / "s.gpkg", SURVEY, meta={}, force=True) as file:
        running = None

        def stop_after_three(event):
            if isinstance(event, Reached) and event.count == 3:
                running.stop("the operator wants her boat back")

        running = mission(SurveyRecorder(file), listeners=[stop_after_three])
        report = running.run()
        assert report.ended is EndReason.STOPPED
        assert (report.reached, file.progress().reached) == (3, 3)
        last = file.events()[-1]
        assert (last.code, last.message) == (
            "stopped_by_operator",
            "the operator wants her boat back",
        )
        assert run_simulated(file, resume=True).complete


class TakenOver(SimulatedLink):
    """A boat whose pilot takes over after a hundred estimates."""

    seen = 0

    def observe(self):
        self.seen += 1
        return super().observe()

    def status(self):
        request = "the pilot took over" if self.seen > 100 else ""
        return BoatStatus(mode="MANUAL", armed=True, stop_request=request)


def test_a_boat_can_ask_for_the_end():
    report = mission(MemoryRecorder(), link=boat(TakenOver)).run()
    assert (report.ended, report.message) == (EndReason.STOPPED, "the pilot took over")


def test_a_signal_is_recorded_before_it_is_passed_on():
    recorder = MemoryRecorder()

    def signal(event):
        if isinstance(event, Reached):
            raise StoppedError("stopped by a signal")

    class Signalled(MemoryRecorder):
        def record(self, event):
            recorder.record(event)
            signal(event)

    link = boat()
    with pytest.raises(StoppedError):
        mission(Signalled(), link=link).run()
    assert recorder.events[-1].reason is EndReason.STOPPED
    assert not link.status().armed


def test_a_mission_that_runs_out_of_time_is_reported_so():
    report = mission(MemoryRecorder(), settings=MissionSettings(limit_s=5.0)).run()
    assert report.ended is EndReason.OUT_OF_TIME
    assert not report.complete


def test_no_listener_can_harm_a_mission():
    """A display that fails, even while it prints, is dropped; the other listeners remain."""
    heard = []

    def broken(event):
        Path("/dev/full").write_text("progress")

    report = mission(MemoryRecorder(), listeners=[broken, heard.append]).run()
    assert report.complete
    assert isinstance(heard[-1], Ended)


def test_a_recorder_that_fails_ends_the_mission_with_the_boat_at_rest():
    class Full(MemoryRecorder):
        def record(self, event):
            if isinstance(event, SampleTaken):
                raise OSError("no space left on device")
            super().record(event)

    link, recorder = boat(), Full()
    with pytest.raises(OSError, match="no space"):
        mission(recorder, link=link).run()
    assert not link.status().armed
    assert recorder.events[-1].reason is EndReason.FAILED


def test_the_log_keeps_reasons_and_warnings_and_neither_track_nor_samples(heard):
    recorder, _ = heard
    kept = [entry for event in recorder.events if (entry := log_entry(event))]
    assert [entry.code for entry in kept] == ["mission_started", "mission_complete"]


class Waiting:
    """Another kind of helm, always full ahead, in the same loop."""

    vessel, step_s = SURVEY.vessel, 0.5

    def __init__(self):
        self.reached, self.asked = 0, []

    def step(self, state, weather, elapsed_s):
        from grebe.control.controller import Command, StepStatus

        self.asked.append(elapsed_s)
        full = self.vessel.thrust_max_n
        return Command(
            thrusts=(full, full), plan=None, status=StepStatus.SOLVED, target=self.reached, split=0
        )


def test_any_helm_steers_through_the_same_loop():
    helm = Waiting()
    trial = simulate(SURVEY.vessel, SURVEY.sets, helm, (0, 0, 0, 0, 0, 0), Conditions(limit_s=20.0))
    assert trial.report.ended is EndReason.OUT_OF_TIME
    assert helm.asked[0] is None
    assert helm.asked[1:] == pytest.approx([0.5] * (len(helm.asked) - 1))
    assert trial.track[-1, 4] == pytest.approx(SURVEY.vessel.speed_max_mps, rel=0.01)
    assert np.all(trial.thrusts[1:] == SURVEY.vessel.thrust_max_n)


def test_a_progress_counts_what_a_new_order_adds():
    told = []
    meter = ProgressMeter(told.append)
    begun = {"time": NOON, "elapsed_s": 0.0}
    meter(Started(**begun, targets=4, reached=0))
    meter(Revised(**begun, revision=None, more=3))
    meter(Reached(**begun, target_seq=1, count=1))
    assert (told[-1].reached, told[-1].targets) == (1, 7)


def test_a_failing_listener_is_dropped_and_that_is_recorded():
    kept = []

    class Keeper:
        def record(self, event):
            kept.append(event)

    def fails(event):
        raise ValueError("no screen")

    broadcast = Broadcast(Keeper(), [fails])
    for _ in range(3):
        broadcast.hold(Started(time=NOON, elapsed_s=0.0, targets=1, reached=0))
        broadcast.release()
    dropped = [one for one in kept if getattr(one, "code", "") == "listener_dropped"]
    assert len(dropped) == 1
    assert "no screen" in dropped[0].message
