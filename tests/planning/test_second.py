"""A second survey follows the first in one file, for any boats and batteries."""

from __future__ import annotations

from dataclasses import replace

import pytest
import shapely
from conftest import FRAME, square_survey

from grebe.core.errors import InputError
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.revision import begun_anew, first_revision, survey_of
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region, water_of
from grebe.planning.revisions.second import followed_by
from grebe.planning.sortie_check import check_sorties
from grebe.planning.sorties import plan_sorties
from grebe.workflow.files import write_survey

POND = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 40, 40))
BOAT = PRESETS["spyboat"]
TWO = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=2), sorties=SortieSettings(minutes=9.0))


@pytest.fixture(scope="module")
def followed():
    """A survey of one mission, and the revision in which two boats' sorties follow it."""
    survey = square_survey(40.0, 10.0)
    second = plan_fleet(POND, BOAT, replace(TWO, sorties=None)).revision
    old = first_revision(survey)
    return survey, old, followed_by(old, survey, second, settings=TWO, note="more")


def test_what_was_sailed_becomes_the_first_sortie_and_stays_as_it_was(followed):
    survey, old, new = followed
    first, *more = new.sorties
    assert (first.number, first.first, first.last, first.boat) == (1, 1, len(old.targets), 1)
    assert new.targets[: len(old.targets)] == old.targets == survey.targets
    assert new.corridors[: len(old.corridors)] == old.corridors
    assert [(one.number, one.boat) for one in more] == [(2, 1), (3, 2)]
    assert min(t.seq for t in new.targets[len(old.targets) :]) == old.highest_seq + 1


def test_what_is_planned_for_other_boats_has_settings_of_its_own(followed, tmp_path):
    survey, old, new = followed
    path = tmp_path / "s.gpkg"
    write_survey(path, survey)
    with SurveyFile.open(path) as file:
        file.append_revision(new)
        assert file.survey.settings == TWO
    with SurveyFile.open(path) as file:
        assert file.survey.settings == file.revision.settings == TWO
        assert [one.settings for one in file.revisions()] == [survey.settings, TWO]
        part = survey_of(file.survey, file.revision, file.revision.sorties[-1])
        assert part.settings == TWO
        # A mission that is begun anew sails the first plan, with the boat that it was made for.
        again = begun_anew(file.revisions())
        assert again is not None
        assert again.settings == survey.settings
        file.append_revision(again)
        assert file.survey.fleet is None
    with SurveyFile.open(path) as file:
        assert file.survey.settings == survey.settings != TWO
        assert [t.seq for t in file.revision.targets] == [t.seq for t in old.targets]


def test_a_third_survey_follows_the_second(followed):
    survey, _, new = followed
    third = followed_by(new, survey, new_of_two(), settings=TWO, note="and more")
    assert [one.number for one in third.sorties] == [1, 2, 3, 4, 5]
    with pytest.raises(InputError, match="same number"):
        replace(third, sorties=(*third.sorties[:-1], replace(third.sorties[-1], number=1)))


def new_of_two():
    return plan_fleet(POND, BOAT, replace(TWO, sorties=None)).revision


def test_sorties_of_cells_that_must_be_entered_deep_are_home_in_time():
    settings = replace(
        TWO, cell_m=8.0, core=0.3, fleet=None, sorties=SortieSettings(minutes=5.0)
    )  # fmt: skip
    region = replace(POND, water=shapely.box(0, 0, 90, 60))
    planned = plan_sorties(region, BOAT, settings)
    checks = check_sorties(planned.survey, planned.revision, water_of(planned.survey))
    assert len(checks) > 1
    assert all(one.holds for one in checks), checks
