"""Every order that a survey has had is unchanged in its file."""

import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
import shapely

from grebe.core.errors import SurveyFileError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.revision import Sortie, first_revision, numbered_on, revised
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan
from grebe.planning.region import Region

NOW = datetime(2026, 5, 1, 8, 30, tzinfo=UTC)
DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def survey():
    frame = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
    region = Region(name="pond", frame=frame, water=shapely.box(0, 0, 30, 40))
    return plan(region, PRESETS["spyboat"], PlanSettings(cell_m=10.0)).survey


def halves(survey):
    middle, last = len(survey.targets) // 2, len(survey.targets)
    return [
        Sortie(number=i, first=a, last=b, start=survey.start, time_s=100.5, energy_wh=2.25, boat=i)
        for i, a, b in ((1, 1, middle), (2, middle + 1, last))
    ]


def test_orders_are_appended_and_read_back_as_they_were(tmp_path, survey):
    path = tmp_path / "pond.gpkg"
    first = first_revision(survey, halves(survey), NOW)
    with SurveyFile.create(path, survey, meta={}, force=False, revision=first) as file:
        assert file.revision.sorties[1].boat == 2
        (transit,) = numbered_on(first, [replace(survey.targets[0], kind="transit", cell=None)])
        order = [*survey.targets[:3], transit, *reversed(survey.targets[4:])]
        ways = [survey.corridors[0]] * len(order)
        second = revised(
            first, reason="unreachable", note="target 4 is out of reach", targets=order,
            corridors=ways, made_at=NOW,
        )  # fmt: skip
        file.append_revision(second)
        assert [t.seq for t in file.survey.targets] == [t.seq for t in order]
        file.mark_reached(transit.seq, NOW)
        assert [when is not None for when in file.progress().reached_at].index(True) == 3
    with SurveyFile.open(path) as file:
        one, two = file.revisions()
        assert (one.note, two.note) == ("", "target 4 is out of reach")
        assert (two.reason, two.made_at) == ("unreachable", NOW)
        assert file.revision.highest_seq == two.highest_seq == len(survey.targets) + 1
        assert [t.seq for t in one.targets] == [t.seq for t in survey.targets]
        assert [t.seq for t in two.targets] == [t.seq for t in order]
        for told, kept in zip(ways, two.corridors, strict=True):
            assert kept.equals_exact(told, 1e-6)
        for told, kept in zip(halves(survey), one.sorties, strict=True):
            assert (kept.first, kept.last, kept.boat) == (told.first, told.last, told.boat)
            assert (kept.time_s, kept.energy_wh) == (100.5, 2.25)
            assert kept.start.north_m == pytest.approx(told.start.north_m, abs=1e-6)
        assert not two.sorties
        assert [t.seq for t in file.survey.targets] == [t.seq for t in order]


def test_a_revision_of_another_order_than_the_files_is_refused(tmp_path, survey):
    with SurveyFile.create(tmp_path / "p.gpkg", survey, meta={}, force=False) as file:
        second = revised(file.revision, reason="closed", note="", targets=file.survey.targets[:2])
        file.append_revision(second)
        with pytest.raises(SurveyFileError, match="does not follow"):
            file.append_revision(second)
        assert len(file.revisions()) == 2


@pytest.mark.parametrize("name", ["core_0_1_0.gpkg", "mission_0_1_0.gpkg", "track_0_1_0.gpkg"])
def test_the_plan_of_an_old_file_is_its_first_revision(tmp_path, name):
    with SurveyFile.open(Path(shutil.copy(DATA / name, tmp_path))) as file:
        (only,) = file.revisions()
        assert (only.number, only.reason) == (1, "planned")
        assert only.targets == file.survey.targets
        assert only.corridors == file.survey.corridors
