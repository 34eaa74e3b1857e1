"""Complete campaigns: pure missions, the order of results, resumption, the page, the command."""

import json
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME, square_survey

from grebe.campaigns.certificate import Claim, Verdict, clopper_pearson_lower
from grebe.campaigns.engine import Serial
from grebe.campaigns.page import numbers, sentence, write_report
from grebe.campaigns.reading import read_campaign
from grebe.campaigns.results import Results, read_part
from grebe.campaigns.run import run_campaign
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.campaigns.task import Scene, Summary, clearance_m
from grebe.cli.main import grebe
from grebe.core.errors import InputError, LinkError, StoppedError, UsageError
from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.vessel import PRESETS
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.workflow.files import write_survey

pytest.importorskip("pyarrow")

SURVEY = square_survey()


def campaign(claim=None, missions=100, **spreads):
    drawn = {name: spread_of(name, value) for name, value in spreads.items()}
    return Campaign(
        name="trial",
        success=Success(within_s=120.0),
        claim=claim or Claim(),
        missions=missions,
        spreads=drawn,
    )


def summary_of(number, success):
    """The summary of a mission, without sailing it."""
    return Summary(
        number=number,
        success=success,
        in_time=success,
        in_water=True,
        reached=4 if success else 2,
        targets=4,
        duration_s=50.0 if success else 300.0,
        clearance_m=1.5,
        path_m=40.0,
        energy_wh=1.0,
        ended="mission_complete",
        error="",
        drawn=campaign().drawn(number),
    )


class Known:
    """An engine with known results, which it yields in a given order."""

    def __init__(self, succeeds, ahead=1, fails_after=None):
        self.succeeds, self.ahead, self.fails_after = succeeds, ahead, fails_after
        self.given = []

    def results(self, task, items):
        waiting, items, shuffled = [], iter(items), random.Random(5)
        while True:
            while len(waiting) < self.ahead and (item := next(items, None)) is not None:
                waiting.append(item)
            if not waiting:
                return
            item = waiting.pop(shuffled.randrange(len(waiting)))
            if self.fails_after is not None and len(self.given) == self.fails_after:
                raise LinkError("the workers are gone")
            self.given.append(item)
            yield item, summary_of(item, self.succeeds(item))


def outcome_of(folder, engine, claim=None, missions=400, identity="a"):
    return run_campaign(
        campaign(claim, missions), SURVEY, Results(folder, identity), engine, lambda *_: None
    )


CLAIM = Claim(confidence=0.99, share=0.9)


def test_a_mission_is_a_pure_function_of_settings_and_number():
    scene = Scene(
        campaign=campaign(current_mps=[0, 0.2], velocity_noise_mps=0.02, mismatch=0.1),
        survey=SURVEY,
    )
    assert scene(3) == scene(3)
    assert scene(3).drawn != scene(4).drawn
    assert scene(3).success
    assert scene(3).clearance_m > 0


def test_a_current_that_is_too_strong_is_a_failure_and_kept():
    one = Scene(campaign=campaign(current_mps=4.0), survey=SURVEY)(0)
    assert not one.success
    assert one.reached < one.targets


def test_clearance_is_negative_outside_and_in_no_go_zones():
    survey = replace(SURVEY, no_go=(shapely.box(8, 8, 12, 12),))
    assert clearance_m(SURVEY, [[10, 10], [3, 10]]) == pytest.approx(3)
    assert clearance_m(SURVEY, [[10, 10], [-2, 10]]) == pytest.approx(-2)
    assert clearance_m(survey, [[3, 3], [9, 10]]) == pytest.approx(-1)


def test_the_verdict_is_the_same_in_whatever_order_missions_come(tmp_path):
    def succeeds(number):
        return number % 40 != 3

    plain = outcome_of(tmp_path / "a", Known(succeeds), CLAIM)
    mixed = outcome_of(tmp_path / "b", Known(succeeds, ahead=12), CLAIM)
    assert plain.verdict is Verdict.CERTIFIED
    assert plain == mixed
    assert [one.number for one in mixed.missions] == list(range(len(mixed.missions)))
    assert len(plain.missions) < 400


def test_a_campaign_that_was_cut_off_goes_on_to_the_same_end(tmp_path):
    def succeeds(number):
        return number % 40 != 3

    whole = outcome_of(tmp_path / "whole", Known(succeeds, ahead=3), CLAIM)
    sailed = 0
    for _ in range(20):
        engine = Known(succeeds, ahead=3, fails_after=17)
        try:
            outcome = outcome_of(tmp_path / "cut", engine, CLAIM)
        except LinkError:
            sailed += len(engine.given)
            continue
        sailed += len(engine.given)
        break
    assert outcome == whole
    assert sailed == len(list(Results(tmp_path / "cut", "a").known))  # none was sailed twice


def test_a_fixed_number_has_clopper_and_pearson_s_limit(tmp_path):
    outcome = outcome_of(tmp_path, Known(lambda n: n != 5), Claim(confidence=0.95), missions=60)
    assert outcome.limit == clopper_pearson_lower(59, 60, 0.95)
    assert numbers(outcome)["method"] == "Clopper-Pearson"


def test_another_campaign_s_folder_is_refused(tmp_path):
    outcome_of(tmp_path, Known(lambda n: True), missions=30)
    with pytest.raises(InputError, match="another campaign"):
        Results(tmp_path, "b")
    assert not Results(tmp_path, "b", force=True).known


def test_results_are_parquet_that_any_reader_reads(tmp_path):
    outcome_of(tmp_path, Known(lambda n: n % 3 > 0), missions=50)
    import pyarrow.parquet as pq

    table = pq.read_table(tmp_path / "missions").to_pylist()
    assert sorted(row["number"] for row in table) == list(range(50))
    assert {"success", "clearance_m", "wind_n", "rule"} <= set(table[0])
    part = next((tmp_path / "missions").glob("*.parquet"))
    part.write_bytes(b"damaged")
    with pytest.raises(InputError, match="simulated again"):
        read_part(part)


def test_the_report_says_what_was_found_and_rounds_no_limit_up(tmp_path):
    outcome = outcome_of(tmp_path, Known(lambda n: n % 40 != 3), CLAIM)
    assert f"at least {int(outcome.limit * 1000) / 10} %" in sentence(outcome)
    files = write_report(outcome, tmp_path)
    told = json.loads(files[0].read_text())
    assert told["successes"] == outcome.successes
    page = files[2].read_text()
    assert sentence(outcome) in page
    assert "certified" in page
    assert files[1].stat().st_size > 10_000


FILE = """
survey = "survey.gpkg"
missions = 3
[success]
within_minutes = 2
[claim]
confidence = 0.9
[draw]
current_mps = [0, 0.1]
"""


def run(*words):
    result = CliRunner().invoke(grebe, words, catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    return result


@pytest.mark.slow
def test_the_command_sails_resumes_and_certifies(tmp_path):
    write_survey(tmp_path / "survey.gpkg", SURVEY)
    file = tmp_path / "pond.toml"
    file.write_text(FILE)
    first = json.loads(run("campaign", str(file), "--workers", "1", "--json").stdout)
    assert first["successes"] == first["missions"] == 3
    assert first["lower_limit"] == pytest.approx(0.1 ** (1 / 3))
    again = json.loads(run("campaign", str(file), "--workers", "1", "--json").stdout)
    assert again == first
    serial = Scene(campaign=read_campaign(file).campaign, survey=read_campaign(file).survey)
    kept = Results(tmp_path / "pond", read_campaign(file).identity).known
    assert dict(Serial().results(serial, range(3))) == kept


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("within_minutes = 2", ""), "within_minutes"),
        (("missions = 3", "missions = 0"), "missions"),
        (("missions = 3", 'missions = "3"'), "number"),
        (("current_mps", "curent_mps"), "curent_mps"),
        (("[draw]", "[drawn]"), "drawn"),
        (("survey.gpkg", "none.gpkg"), "none.gpkg"),
        (("current_mps = [0, 0.1]", 'rule = "triple"'), "triple"),
        (("survey", "= survey"), "TOML"),
    ],
)
def test_an_error_in_a_campaign_file_is_reported(tmp_path, change, said):
    write_survey(tmp_path / "survey.gpkg", SURVEY)
    file = tmp_path / "pond.toml"
    file.write_text(FILE.replace(*change, 1))
    with pytest.raises((InputError, UsageError), match=said):
        read_campaign(file)


def test_that_somebody_stops_it_is_no_failure_of_a_mission(monkeypatch):
    def stopped(*_):
        raise StoppedError("told to end")

    monkeypatch.setattr("grebe.campaigns.task.sail", stopped)
    with pytest.raises(StoppedError):
        Scene(campaign=campaign(), survey=SURVEY)(3)


def test_a_simulation_that_cannot_be_computed_is_a_failure_and_kept(monkeypatch):
    def diverges(*_):
        raise ValueError("math domain error")

    monkeypatch.setattr("grebe.campaigns.task.sail", diverges)
    found = Scene(campaign=campaign(), survey=SURVEY)(3)
    assert (found.success, found.error) == (False, "math domain error")


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("mismatch", 1.0, "a share below 1"),
        ("lost_share", [0.0, 1.0], "a share below 1"),
        ("late_s", 1e9, "which is too large; give at most 10"),
        ("position_noise_m", 1e9, "give at most 100"),
    ],
)
def test_what_no_mission_can_be_drawn_from_is_refused(name, value, says):
    with pytest.raises(UsageError, match=says):
        campaign(**{name: value})


def test_another_survey_is_another_campaign(tmp_path):
    told = set()
    sets = [replace(one, set=replace(one.set, speed_max_mps=1.9)) for one in SURVEY.targets]
    others = (
        SURVEY,
        replace(SURVEY, targets=tuple(sets)),
        replace(SURVEY, no_go=(shapely.box(1, 1, 2, 2),)),
    )
    for k, survey in enumerate(others):
        path = tmp_path / f"{k}.gpkg"
        write_survey(path, survey)
        file = tmp_path / f"{k}.toml"
        file.write_text(f"survey = '{path}'\n[success]\nwithin_minutes = 2\n")
        told.add(read_campaign(file).identity)
    assert len(told) == 3


@pytest.mark.parametrize("draw", ["draw = 5", "draw = [1]"])
def test_a_table_that_is_not_one_is_reported(tmp_path, draw):
    path = tmp_path / "s.gpkg"
    write_survey(path, SURVEY)
    file = tmp_path / "c.toml"
    file.write_text(f"survey = '{path}'\n{draw}\n[success]\nwithin_minutes = 2\n")
    with pytest.raises(InputError, match="draw must be a table"):
        read_campaign(file)


def test_of_a_plan_in_sorties_a_mission_sails_one_that_is_named(tmp_path):
    """Regression: a fleet's plan was certified as if its first boat sailed all of it."""
    wanted = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=2))
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 40, 40))
    planned = plan_fleet(region, PRESETS["spyboat"], wanted)
    write_survey(tmp_path / "two.gpkg", planned.survey, revision=planned.revision)
    file = tmp_path / "c.toml"
    rest = "[success]\nwithin_minutes = 5\n"
    file.write_text(f'survey = "two.gpkg"\n{rest}')
    with pytest.raises(InputError, match=r"2 sorties.*sortie = 1"):
        read_campaign(file)
    told = set()
    for number in (1, 2):
        file.write_text(f'survey = "two.gpkg"\nsortie = {number}\n{rest}')
        read = read_campaign(file)
        own = planned.revision.sortie(number)
        assert len(read.survey.targets) == len(own)
        assert read.survey.start.north_m == pytest.approx(own.start.north_m, abs=1e-4)
        told.add(read.identity)
    assert len(told) == 2
    file.write_text(f'survey = "two.gpkg"\nsortie = 9\n{rest}')
    with pytest.raises(UsageError, match="no sortie 9"):
        read_campaign(file)


SAILED = """
import sys
from benchmarks.campaign import SMALL, WEATHER, survey_of
from grebe.campaigns.certificate import Claim
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.campaigns.task import Scene

drawn = {key: spread_of(key, value) for key, value in WEATHER.items()}
success, claim = Success(within_s=120.0), Claim()
campaign = Campaign(name="kills", success=success, claim=claim, missions=60, spreads=drawn)
sail = Scene(campaign=campaign, survey=survey_of(SMALL, 10.0))
print([sail(int(number)) for number in sys.argv[1:]][-1])
"""


@pytest.mark.slow
def test_a_mission_is_the_same_whatever_its_process_has_sailed_before():
    """Regression: of 60 missions this one differed in its last digits after number 4 alone."""
    root = Path(__file__).parents[2]
    told = [
        subprocess.run(
            [sys.executable, "-c", SAILED, *numbers],
            check=True, capture_output=True, text=True, cwd=root,
        ).stdout
        for numbers in (["5"], ["4", "5"])
    ]  # fmt: skip
    assert told[0].startswith("Summary(number=5")
    assert told[0] == told[1]
