"""The rest of an order is replanned: reached targets stay, and all remaining cells are visited."""

from dataclasses import replace

import pytest
import shapely

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.revision import first_revision, left_out, survey_of
from grebe.core.vessel import PRESETS
from grebe.planning.check import check_plan
from grebe.planning.planner import plan
from grebe.planning.region import Region, navigable_water
from grebe.planning.revisions.revise import Halfway, open_water, remaining_s, replanned
from grebe.planning.sorties import plan_sorties

BOAT = PRESETS["blueboat"]
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
WATER = shapely.box(0, 0, 300, 400).difference(shapely.box(120, 100, 180, 400))
REGION = Region(name="fork", frame=FRAME, water=WATER)
SETTINGS = PlanSettings(cell_m=20.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0)
USABLE, _ = navigable_water(REGION, [], 1.0)


@pytest.fixture(scope="module")
def survey():
    return plan(REGION, BOAT, SETTINGS).survey


def halfway(survey, reached, sortie=None):
    north, east = survey.targets[reached - 1].set.centre
    return Halfway(reached=reached, place=(north, east), sortie=sortie)


def rest_of(survey, new, reached, place):
    """The targets ahead in a revision, as a survey that begins at the boat's place."""
    start = replace(survey.start, north_m=place[0], east_m=place[1])
    ahead = (new.targets[reached:], new.corridors[reached:])
    return replace(survey, targets=ahead[0], corridors=ahead[1], start=start)


def test_what_is_left_is_visited_in_the_water_and_what_was_reached_stays(survey):
    old, where = first_revision(survey), halfway(survey, 40)
    new = replanned(
        old, survey, open_water(survey, USABLE), where, vessel=BOAT, weather=CALM,
        reason="unreachable", note="", without={survey.targets[41].seq},
    )  # fmt: skip
    assert new.targets[:40] == old.targets[:40]
    assert left_out(old, new) == (survey.targets[41].seq,)
    part = rest_of(survey, new, 40, where.place)
    assert check_plan(part, USABLE).outside_m2 == 0.0


def test_in_another_current_the_new_order_is_no_slower_than_the_old(survey):
    old, where = first_revision(survey), halfway(survey, 20)
    current = Weather(current_north_mps=0.5)
    new = replanned(
        old, survey, open_water(survey, USABLE), where, vessel=BOAT, weather=current,
        reason="weather", note="",
    )  # fmt: skip
    before, after = (
        remaining_s(survey, where.place, one.targets[20:], current, BOAT) for one in (old, new)
    )
    assert after <= before


def test_a_closed_area_is_kept_out_of_and_what_lies_behind_it_is_still_visited(survey):
    old, where = first_revision(survey), halfway(survey, 10)
    zone = shapely.box(200, 150, 260, 210)
    new = replanned(
        old, survey, open_water(survey, USABLE).closing([zone], where.place), where,
        vessel=BOAT, weather=CALM, reason="closed", note="",
    )  # fmt: skip
    gone = {t.seq for t in survey.targets if t.set.polygon.intersection(zone).area > 1e-6}
    ahead = {t.seq for t in survey.targets[10:] if t.kind == "cell"}
    assert set(left_out(old, new)) == gone & ahead
    part = rest_of(survey, new, 10, where.place)
    assert check_plan(part, USABLE.difference(zone)).outside_m2 == 0.0


STRAIT = shapely.box(0, 0, 60, 300)


@pytest.fixture(scope="module")
def strait():
    region = Region(name="strait", frame=FRAME, water=STRAIT)
    return plan(region, BOAT, replace(SETTINGS, cell_m=20.0)).survey


def closed_revision(survey, zone, place, reached=0):
    return replanned(
        first_revision(survey), survey, open_water(survey, STRAIT).closing([zone], place),
        Halfway(reached=reached, place=place), vessel=BOAT, weather=CALM, reason="closed", note="",
    )  # fmt: skip


def test_what_a_closed_area_leaves_of_cells_still_carries_a_path(strait):
    """A closed area cuts every cell of a strait's middle row: none of them stays complete."""
    zone = shapely.box(5, 145, 55, 155)
    new = closed_revision(strait, zone, (30.0, 20.0))
    cells = [t.set.polygon for t in new.targets if t.kind == "cell"]
    assert any(cell.bounds[1] > 160 for cell in cells)
    assert not any(cell.intersection(zone).area > 1e-6 for cell in cells)
    part = rest_of(strait, new, 0, (30.0, 20.0))
    assert check_plan(part, STRAIT.difference(zone)).outside_m2 == 0.0


def test_what_lies_behind_a_closed_area_and_cannot_be_come_to_is_left_out(strait):
    zone = shapely.box(0, 145, 60, 155)
    for place, near in (((30.0, 20.0), True), ((30.0, 250.0), False)):
        new = closed_revision(strait, zone, place)
        cells = [t.set.polygon for t in new.targets if t.kind == "cell"]
        assert cells
        assert all((cell.bounds[3] <= 145) == near for cell in cells)


def test_a_boat_in_the_area_that_is_closed_is_led_out_of_it(strait):
    zone = shapely.box(5, 100, 55, 160)
    new = closed_revision(strait, zone, (30.0, 130.0))
    first = new.targets[0].set.polygon
    assert first.intersection(zone).area < 1e-6
    assert new.corridors[0].buffer(1e-6).covers(shapely.Point(30.0, 130.0))
    rest = shapely.union_all(list(new.corridors[1:]))
    assert rest.intersection(zone).area < 1e-6


def test_an_area_that_closes_every_cell_is_reported(strait):
    with pytest.raises(PlanError, match="can reach no more cells"):
        open_water(strait, STRAIT).closing([shapely.box(2, 2, 58, 298)], (30.0, 30.0))
    with pytest.raises(PlanError, match="no water is left"):
        open_water(strait, STRAIT).closing([shapely.box(-1, -1, 61, 301)], (30.0, 30.0))


def test_a_replanned_sortie_ends_at_its_harbour_and_the_others_stay():
    lon, lat = FRAME.to_wgs84((5.0, 5.0)).tolist()
    bounds = SortieSettings(minutes=25.0, harbours=((lon, lat),))
    planned = plan_sorties(REGION, BOAT, replace(SETTINGS, cell_m=30.0, sorties=bounds))
    old, survey = planned.revision, planned.survey
    part = survey_of(survey, old, old.sorties[1])
    new = replanned(
        old, survey, open_water(survey, USABLE), halfway(part, 5, old.sorties[1]), vessel=BOAT,
        weather=CALM, reason="unreachable", note="", without={part.targets[7].seq},
    )  # fmt: skip
    again = survey_of(survey, new, new.sortie(2))
    assert again.targets[:5] == part.targets[:5]
    assert again.targets[-1] == part.targets[-1]
    for one in old.sorties:
        if one.number != 2:
            kept = survey_of(survey, new, new.sortie(one.number))
            assert kept.targets == survey_of(survey, old, one).targets


def test_where_nothing_is_left_there_is_no_order(survey):
    old, where = first_revision(survey), halfway(survey, len(survey.targets))
    with pytest.raises(PlanError, match="No cell"):
        replanned(
            old, survey, open_water(survey, USABLE), where, vessel=BOAT, weather=CALM,
            reason="weather", note="",
        )  # fmt: skip
