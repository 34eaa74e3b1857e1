"""Sorties contain every cell once, stay in the water, and let the boat get home from anywhere."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError, UsageError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan
from grebe.planning.region import Region, navigable_water
from grebe.planning.sortie_check import check_sorties
from grebe.planning.sorties import plan_sorties

BOAT = PRESETS["blueboat"]
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
# A lake bent around a spit, with two islands.
WATER = (
    shapely.box(0, 0, 900, 700)
    .difference(shapely.box(300, 250, 380, 700))
    .difference(shapely.box(600, 150, 700, 260))
    .difference(shapely.box(120, 400, 200, 460))
)
REGION = Region(name="bend", frame=FRAME, water=WATER)
SOUTH, NORTH = (FRAME.to_wgs84(place).tolist() for place in ((5.0, 20.0), (890.0, 600.0)))


def settings(*, weather=None, **bounds):
    bounds.setdefault("harbours", (tuple(SOUTH),))
    return PlanSettings(
        cell_m=60.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0,
        weather=weather or Weather(), sorties=SortieSettings(**bounds),
    )  # fmt: skip


@pytest.fixture(scope="module")
def by_minutes():
    return plan_sorties(REGION, BOAT, settings(minutes=50.0))


def test_every_cell_is_in_one_sortie_and_the_cells_are_those_of_a_plan_without(by_minutes):
    whole = plan(REGION, BOAT, replace(settings(minutes=50.0), sorties=None))
    told = {c.normalize().wkt for c in shapely.set_precision(whole.survey.cells, 1e-3).tolist()}
    cells = shapely.set_precision(by_minutes.survey.cells, 1e-3).tolist()
    assert len(cells) == len(told)
    assert {cell.normalize().wkt for cell in cells} == told
    assert by_minutes.check.coverage == pytest.approx(whole.check.coverage)


@pytest.mark.parametrize(
    "bounds",
    [
        {"battery_wh": 110.0, "reserve": 0.3},
        {"minutes": 40.0, "harbours": (tuple(SOUTH), tuple(NORTH))},
        {"minutes": 60.0, "weather": Weather(current_north_mps=0.2, wind_force_east_n=5.0)},
    ],
)
def test_home_is_reached_along_the_water_from_every_place_in_time(bounds):
    planned = plan_sorties(REGION, BOAT, settings(**bounds))
    water, _ = navigable_water(REGION, [], 1.0)
    checks = check_sorties(planned.survey, planned.revision, water)
    assert len(checks) == len(planned.revision.sorties) > 1
    assert all(one.holds for one in checks), checks
    assert planned.check.holds
    starts = {(s.start.north_m, s.start.east_m) for s in planned.revision.sorties}
    assert len(starts) <= len(bounds.get("harbours", [1]))


def test_the_check_finds_a_sortie_that_is_too_long_or_crosses_land(by_minutes):
    water, _ = navigable_water(REGION, [], 1.0)
    survey, revision = by_minutes.survey, by_minutes.revision
    hurried = replace(revision, settings=settings(minutes=20.0))
    assert not any(one.holds for one in check_sorties(survey, hurried, water))
    dammed = water.difference(shapely.box(440, -1, 450, 230))
    assert sum(one.outside_m2 > 0 for one in check_sorties(survey, revision, dammed)) > 0


def test_a_sortie_ends_where_it_began(by_minutes):
    for sortie in by_minutes.revision.sorties:
        last = by_minutes.revision.targets[sortie.last - 1]
        assert last.kind == "transit"
        start = (sortie.start.north_m, sortie.start.east_m)
        assert last.set.footprint_distance(*start) == 0.0


def test_the_trips_are_near_a_bound_that_no_trips_go_below(by_minutes):
    assert 1.0 <= by_minutes.legs_s / by_minutes.bound_s < 1.15


def test_the_same_settings_give_the_same_sorties():
    one, again = (plan_sorties(REGION, BOAT, settings(minutes=2_000.0)) for _ in range(2))
    assert [t.set for t in again.survey.targets] == [t.set for t in one.survey.targets]


def test_a_cell_from_which_no_sortie_comes_home_is_reported():
    with pytest.raises(PlanError, match="farthest from a harbour"):
        plan_sorties(REGION, BOAT, settings(minutes=8.0))
    with pytest.raises(PlanError, match=r"cannot get home|over ground"):
        plan_sorties(REGION, BOAT, settings(minutes=50.0, weather=Weather(current_east_mps=2.5)))


@pytest.mark.parametrize("bounds", [{}, {"minutes": -1.0}, {"minutes": 5.0, "reserve": 1.0}])
def test_bounds_that_are_none_are_refused(bounds):
    with pytest.raises(UsageError):
        SortieSettings(**bounds)


def test_one_sortie_is_enough_where_the_battery_is():
    planned = plan_sorties(REGION, BOAT, settings(minutes=2_000.0))
    (only,) = planned.revision.sorties
    assert (only.first, only.last) == (1, len(planned.survey.targets))
    assert np.isclose(only.time_s, planned.outcome.time_s)
