"""Sorties of unlike boats: each gets home in time on its own battery, from its own part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import FRAME

from grebe.core.errors import PlanError, UsageError
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.revision import survey_of
from grebe.core.vessel import PRESETS
from grebe.planning.region import Region, navigable_water
from grebe.planning.sortie_check import check_sorties
from grebe.planning.sorties import plan_sorties

# A lake bent around a spit, with an island.
WATER = (
    shapely.box(0, 0, 600, 450)
    .difference(shapely.box(200, 160, 250, 450))
    .difference(shapely.box(400, 100, 450, 170))
)
REGION = Region(name="bend", frame=FRAME, water=WATER)
SOUTH, NORTH = ((lon, lat) for lon, lat in FRAME.to_wgs84([(5.0, 20.0), (590.0, 400.0)]).tolist())
BOATS = tuple(PRESETS[name] for name in ("blueboat", "otter"))


def wishes(vessels=BOATS, starts=(), boats=2, **bounds):
    if not starts:
        bounds.setdefault("harbours", (SOUTH,))
    fleet = FleetSettings(boats=boats, vessels=vessels, starts=starts)
    return PlanSettings(
        cell_m=40.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0,
        sorties=SortieSettings(**bounds), fleet=fleet,
    )  # fmt: skip


def proved(planned):
    water, _ = navigable_water(REGION, [], 1.0)
    return check_sorties(planned.survey, planned.revision, water)


def spent_s(planned, boat):
    return sum(one.time_s for one in planned.revision.sorties if one.boat == boat)


@pytest.fixture(scope="module")
def by_battery():
    return plan_sorties(REGION, BOATS[0], wishes(batteries_wh=(75.0, 320.0)))


@pytest.mark.parametrize(
    "bounds",
    [
        {"batteries_wh": (75.0, 320.0)},
        {"minutes": 35.0},
        {"minutes_each": (25.0, 40.0), "harbours": (SOUTH, NORTH)},
        {"batteries_wh": (60.0, 500.0), "minutes": 40.0, "reserve": 0.3},
        {"batteries_wh": (70.0, 200.0), "vessels": ()},
    ],
    ids=["batteries", "one limit", "minutes and harbours", "both", "one hull"],
)
def test_every_boat_is_home_in_time_from_every_place_of_its_sorties(bounds):
    planned = plan_sorties(REGION, BOATS[0], wishes(**bounds))
    checks = proved(planned)
    assert len(checks) == len(planned.revision.sorties) > 1
    assert all(one.holds for one in checks), checks
    assert planned.check.holds
    assert {one.boat for one in planned.revision.sorties} == {1, 2}


def test_every_cell_is_in_one_sortie_alone(by_battery):
    cells = [t for t in by_battery.survey.targets if t.kind == "cell"]
    assert len({t.seq for t in cells}) == len(cells)
    assert by_battery.check.coverage > 0.99
    assert by_battery.check.overlap_m2 == pytest.approx(0.0, abs=1e-6)


def test_a_sortie_is_planned_with_the_vessel_and_the_battery_of_its_boat(by_battery):
    survey, revision = by_battery.survey, by_battery.revision
    for sortie in revision.sorties:
        part = survey_of(survey, revision, sortie)
        assert part.vessel == BOATS[sortie.boat - 1]
        assert part.settings.sorties.battery_wh == (75.0, 320.0)[sortie.boat - 1]
        assert sortie.energy_wh < 0.8 * part.settings.sorties.battery_wh


def test_the_check_goes_by_each_boats_own_battery(by_battery):
    """If one boat's battery were half as large, only the sorties of that boat would fail."""
    sorties = replace(by_battery.survey.settings.sorties, batteries_wh=(75.0, 160.0))
    settings = replace(by_battery.survey.settings, sorties=sorties)
    weaker = replace(by_battery, revision=replace(by_battery.revision, settings=settings))
    whose = [one.boat for one in by_battery.revision.sorties]
    holds = [one.holds for one in proved(weaker)]
    assert all(held for held, boat in zip(holds, whose, strict=True) if boat == 1)
    assert not all(held for held, boat in zip(holds, whose, strict=True) if boat == 2)


def test_the_boats_are_out_for_about_as_long_as_each_other(by_battery):
    times = [spent_s(by_battery, boat) for boat in (1, 2)]
    assert max(times) < 1.15 * min(times)


def test_a_small_battery_is_given_what_lies_near_and_takes_as_long_as_a_large_one():
    def share(batteries):
        planned = plan_sorties(REGION, BOATS[0], wishes(vessels=(), batteries_wh=batteries))
        own = [one for one in planned.revision.sorties if one.boat == 1]
        cells = [
            target.set.centre
            for one in own
            for target in survey_of(planned.survey, planned.revision, one).targets
            if target.kind == "cell"
        ]
        return sum(one.time_s for one in own), float(np.mean(np.hypot(*np.transpose(cells))))

    (small_s, near), (large_s, far) = share((60.0, 250.0)), share((250.0, 60.0))
    assert near < far
    assert small_s == pytest.approx(large_s, rel=0.15)


def test_without_a_harbour_each_boat_comes_home_to_its_own_start():
    planned = plan_sorties(REGION, BOATS[0], wishes(minutes=35.0, starts=(NORTH, SOUTH)))
    assert all(one.holds for one in proved(planned))
    for sortie in planned.revision.sorties:
        at = FRAME.to_wgs84((sortie.start.north_m, sortie.start.east_m)).tolist()
        assert at == pytest.approx((NORTH, SOUTH)[sortie.boat - 1], abs=2e-5)


def test_boats_alike_with_starts_of_their_own_come_home_to_them_too():
    planned = plan_sorties(
        REGION, BOATS[0], wishes(vessels=(), minutes=35.0, starts=(NORTH, SOUTH))
    )
    assert all(one.holds for one in proved(planned))
    assert {
        (sortie.boat, round(sortie.start.north_m, -1)) for sortie in planned.revision.sorties
    } == {(1, 590.0), (2, 0.0)}
    both = replace(wishes(minutes=35.0, starts=(NORTH, SOUTH)), sorties=wishes(minutes=9.0).sorties)
    with pytest.raises(UsageError, match="give one or the other"):
        plan_sorties(REGION, BOATS[0], both)


def test_what_a_boat_cannot_do_is_reported_with_its_name():
    with pytest.raises(PlanError, match="Boat 2, otter: the cell farthest from a harbour"):
        plan_sorties(REGION, BOATS[0], wishes(batteries_wh=(200.0, 5.0)))
    slow = wishes(minutes=35.0, vessels=(BOATS[0], PRESETS["tianjin"]))
    with pytest.raises(PlanError, match="tianjin"):
        plan_sorties(REGION, BOATS[0], replace(slow, speed_min_mps=1.4))


def test_batteries_that_are_not_one_for_each_boat_are_refused():
    with pytest.raises(UsageError, match="Give one battery for all 3 boats, or 3, not 2"):
        wishes(boats=3, vessels=(), batteries_wh=(10.0, 20.0))
    with pytest.raises(UsageError, match="One boat takes one number of minutes, not 2"):
        PlanSettings(sorties=SortieSettings(minutes_each=(10.0, 20.0)))
    with pytest.raises(UsageError, match="for all boats and for each"):
        SortieSettings(battery_wh=10.0, batteries_wh=(10.0, 20.0))
    with pytest.raises(UsageError, match="limit of -1"):
        SortieSettings(minutes_each=(10.0, -1.0))
