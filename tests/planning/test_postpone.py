"""Cells for which a slow sortie has no time become a sortie of their own; the others stay."""

import pytest
import shapely

from grebe.core.dynamics import CALM
from grebe.core.errors import PlanError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.revision import survey_of
from grebe.core.vessel import PRESETS
from grebe.planning.region import Region, navigable_water
from grebe.planning.revisions.postpone import Delay, postponed
from grebe.planning.revisions.revise import Halfway, open_water, remaining_s
from grebe.planning.sortie_check import check_sorties
from grebe.planning.sorties import plan_sorties

BOAT = PRESETS["blueboat"]
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
WATER = shapely.box(0, 0, 300, 400).difference(shapely.box(120, 100, 180, 400))
REGION = Region(name="fork", frame=FRAME, water=WATER)
USABLE, _ = navigable_water(REGION, [], 1.0)
REACHED = 8


@pytest.fixture(scope="module")
def planned():
    lon, lat = FRAME.to_wgs84((5.0, 5.0)).tolist()
    settings = PlanSettings(
        cell_m=25.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0,
        sorties=SortieSettings(minutes=25.0, harbours=((lon, lat),)),
    )  # fmt: skip
    return plan_sorties(REGION, BOAT, settings)


def shortened(planned, delay):
    old, survey = planned.revision, planned.survey
    sortie = old.sorties[0]
    north, east = survey_of(survey, old, sortie).targets[REACHED - 1].set.centre
    halfway = Halfway(reached=REACHED, place=(north, east), sortie=sortie)
    new = postponed(
        old, survey, open_water(survey, USABLE), halfway, delay, vessel=BOAT, weather=CALM
    )
    return old, new, halfway


def rest_s(planned, halfway, revision):
    part = survey_of(planned.survey, revision, revision.sortie(1))
    return remaining_s(planned.survey, halfway.place, part.targets[REACHED:], CALM, BOAT)


def cells(targets):
    return [target.seq for target in targets if target.kind == "cell"]


def test_the_last_cells_become_a_sortie_of_their_own_and_none_is_lost(planned):
    north, east = planned.revision.targets[REACHED - 1].set.centre
    whole_s = rest_s(planned, Halfway(reached=REACHED, place=(north, east)), planned.revision)
    delay = Delay(pace=1.3, elapsed_s=200.0, left_s=0.9 * whole_s)
    old, new, halfway = shortened(planned, delay)
    assert new.reason == "progress"
    assert new.number == old.number + 1
    before = [one.number for one in old.sorties]
    assert [one.number for one in new.sorties] == [*before, max(before) + 1]
    assert sorted(cells(new.targets)) == sorted(cells(old.targets))
    assert len({target.seq for target in new.targets}) == len(new.targets)
    assert new.targets[:REACHED] == old.targets[:REACHED]
    assert 1.3 * rest_s(planned, halfway, new) <= delay.left_s
    for one in old.sorties[1:]:
        again = survey_of(planned.survey, new, new.sortie(one.number))
        assert again.targets == survey_of(planned.survey, old, one).targets


def test_a_postponed_sortie_is_proved_to_come_home_like_any_other(planned):
    _, new, _ = shortened(planned, Delay(pace=1.2, elapsed_s=300.0, left_s=500.0))
    checks = check_sorties(planned.survey, new, USABLE)
    assert [one.number for one in checks] == [one.number for one in new.sorties]
    assert all(one.holds for one in checks)
    later = new.sorties[-1]
    assert later.start == new.sorties[0].start
    assert 0 < later.time_s < new.sorties[0].time_s + 500.0


@pytest.mark.parametrize("left_s", [1e6, 1.0])
def test_where_all_fits_or_nothing_the_order_stays(planned, left_s):
    with pytest.raises(PlanError, match="none is moved"):
        shortened(planned, Delay(pace=1.0, elapsed_s=100.0, left_s=left_s))
