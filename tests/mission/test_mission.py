"""Complete missions in simulation: the record agrees with what happened."""

import numpy as np
import pytest
from conftest import NOON, run_simulated, square_survey

from grebe.control.controller import Controller
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.turn_and_go import model_substeps
from grebe.core.dynamics import Weather, rates, rk4
from grebe.core.errors import InputError, LinkError, PlanError, SurveyFileError
from grebe.core.events import EndReason
from grebe.core.survey import Survey
from grebe.io.store import SurveyFile
from grebe.links.simulated import SimulatedLink
from grebe.mission.events.recorders import SurveyRecorder
from grebe.mission.loop import Mission
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import Sonde
from grebe.simulation.water import free_water
from grebe.workflow.simulated import SimulatedWorld


def new_file(tmp_path, **size):
    return SurveyFile.create(tmp_path / "s.gpkg", square_survey(**size), meta={}, force=True)


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    """A mission of nine cells in still water, and its file."""
    file = new_file(tmp_path_factory.mktemp("flown"), side_m=30.0)
    report = run_simulated(file)
    yield file, report
    file.close()


def test_every_cell_is_reached_with_every_step_solved(sailed):
    file, report = sailed
    assert report.complete
    assert report.unsolved_steps == 0
    assert file.progress().reached == 9
    assert min(file.progress().sample_counts) >= 1


def test_every_sample_lies_in_its_set_and_its_speed_window_or_between_sets_in_the_window(sailed):
    file, report = sailed
    samples = file.samples()
    assert 0 < report.samples_in_sets <= report.samples == len(samples)
    assert np.count_nonzero(samples.target_seq) == report.samples_in_sets
    window = file.survey.targets[0].set
    between = samples.target_seq == 0
    assert all(map(window.allows, samples.speed_mps[between]))
    columns = (samples.positions, samples.target_seq, samples.speed_mps)
    for place, seq, speed in zip(*(column[~between] for column in columns), strict=True):
        target = file.survey.targets[seq - 1].set
        assert target.footprint_distance(*place) < 1e-6
        assert target.allows(speed)


def test_the_logged_thrusts_through_the_model_give_the_logged_track(sailed):
    file, _ = sailed
    track = file.track()
    boat = file.survey.vessel
    for k in range(len(track) - 1):
        duration = track.seconds[k + 1] - track.seconds[k]
        z = rk4(
            lambda s, k=k: rates(boat, s, track.thrusts[k]),
            track.states[k],
            duration,
            10 * model_substeps(boat, duration),
        )
        assert track.states[k + 1] == pytest.approx(z, abs=2e-3)


def test_logged_thrusts_keep_the_boat_s_limits(sailed):
    file, _ = sailed
    boat = file.survey.vessel
    assert file.track().thrusts.max() <= boat.thrust_max_n
    assert file.track().thrusts.min() >= boat.thrust_min_n


def test_a_sailed_survey_is_not_sailed_again_by_accident(sailed):
    file, _ = sailed
    with pytest.raises(SurveyFileError, match="resume it"):
        run_simulated(file)


@pytest.mark.slow
@pytest.mark.parametrize("rule", [Dual(), Lookahead()], ids=repr)
def test_an_unknown_current_does_not_stop_the_mission(tmp_path, rule):
    world = SimulatedWorld(weather=Weather(current_north_mps=0.2, current_east_mps=-0.2))
    with new_file(tmp_path, side_m=30.0) as file:
        assert run_simulated(file, rule, world).complete


class Stopping(SimulatedLink):
    """A link that fails after a number of estimates, as if its radio were lost."""

    after, closed = 0, False

    def observe(self):
        self.after -= 1
        if self.after < 0:
            raise LinkError("the radio is gone")
        return super().observe()

    def close(self):
        self.closed = True
        super().close()


def test_a_mission_that_is_cut_off_can_be_resumed(tmp_path):
    with new_file(tmp_path, side_m=30.0) as file:
        survey = file.survey
        plant = Plant(survey.vessel, survey.start.at_rest())
        sonde = Sonde(free_water(survey.water.bounds, 1), 1)
        link = Stopping(plant, sonde)
        link.after = 100
        helm = Controller(survey.vessel, survey.sets)
        cut = Mission(survey, helm, link, SurveyRecorder(file), started=NOON).run()
        assert cut.ended is EndReason.LINK_LOST
        assert file.events()[-1].code == "link_lost"
        assert file.events()[-1].message == "the radio is gone"
        assert link.closed
        reached, samples = file.progress().reached, len(file.samples())
        assert 0 < reached < 9
        report = run_simulated(file, resume=True)
        assert report.complete
        assert file.progress().reached == 9
        assert len(file.samples()) > samples
        assert np.all(np.diff(file.track().seconds) > 0)


def test_a_complete_mission_is_not_prolonged_by_resuming(sailed):
    file, _ = sailed
    samples, events = len(file.samples()), len(file.events())
    report = run_simulated(file, resume=True)
    assert report.complete
    assert (len(file.samples()), len(file.events())) == (samples, events)


def test_two_missions_cannot_share_a_file(tmp_path):
    with new_file(tmp_path) as first, SurveyFile.open(first.path) as second:
        first.claim()
        with pytest.raises(SurveyFileError, match="another mission"):
            second.claim()


def test_most_of_the_path_is_sampled(sailed):
    """There is one reading a second, most of them within the speed window."""
    _, report = sailed
    assert report.samples > 0.6 * report.duration_s


def test_force_forgets_nothing_before_the_new_mission_can_start(tmp_path):
    with new_file(tmp_path) as file:
        run_simulated(file)
        samples = len(file.samples())
        lost = SimulatedWorld(water_from=tmp_path / "none.csv")
        with pytest.raises(InputError):
            run_simulated(file, Lookahead(), lost, force=True)
        assert len(file.samples()) == samples > 0
        again = run_simulated(file, force=True)
        assert again.samples == len(file.samples()) == samples


def test_an_unreachable_target_ends_the_mission_as_incomplete(tmp_path):
    """A current faster than the boat carries it off; the mission soon ends, and says why."""
    world = SimulatedWorld(weather=Weather(current_north_mps=-4.0))
    with new_file(tmp_path) as file:
        report = run_simulated(file, Lookahead(), world)
        assert not report.complete
        assert file.events()[-1].code == "current_beyond_reach"
        assert report.duration_s < 120.0


def test_a_survey_without_targets_cannot_be_sailed(tmp_path):
    planned = square_survey()
    bare = Survey(name="bare", frame=planned.frame, water=planned.water)
    with (
        SurveyFile.create(tmp_path / "b.gpkg", bare, meta={}, force=True) as file,
        pytest.raises(PlanError, match="no targets"),
    ):
        run_simulated(file)


def test_the_same_seed_gives_the_same_mission(tmp_path):
    tables = []
    for name in ("a", "b"):
        survey = square_survey()
        with SurveyFile.create(tmp_path / name, survey, meta={}, force=True) as file:
            run_simulated(file, Lookahead(), SimulatedWorld(seed=5))
            tables.append(file.samples())
    assert np.array_equal(tables[0].positions, tables[1].positions)
    assert np.array_equal(tables[0].values["ph"], tables[1].values["ph"])
