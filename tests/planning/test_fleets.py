"""A survey that is shared out: every cell is in one part, and the parts take about equally long."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from conftest import FRAME
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.core.errors import PlanError, UsageError
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.revision import survey_of
from grebe.core.vessel import PRESETS
from grebe.planning.check import check_plan
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties

# A bay with an island, and a lake that bends around a tongue of land.
BAY = shapely.box(0, 0, 120, 160).difference(shapely.box(50, 60, 80, 100))
BEND = shapely.box(0, 0, 150, 150).difference(shapely.box(50, 60, 150, 90))


def shared(water, boats, cell_m=10.0, **more):
    region = Region(name="x", frame=FRAME, water=water)
    wishes = PlanSettings(cell_m=cell_m, fleet=FleetSettings(boats=boats), **more)
    return plan_fleet(region, PRESETS["spyboat"], wishes)


@pytest.mark.parametrize("water", [BAY, BEND], ids=["island", "bend"])
@pytest.mark.parametrize("boats", [2, 4])
def test_the_slowest_boat_takes_little_more_than_its_share(water, boats):
    planned = shared(water, boats)
    assert {one.boat for one in planned.revision.sorties} == set(range(1, boats + 1))
    assert planned.check.holds
    assert planned.check.coverage > 0.97
    assert planned.legs_s < 1.10 * planned.bound_s
    for sortie in planned.revision.sorties:
        assert check_plan(survey_of(planned.survey, planned.revision, sortie), water).holds


@given(boats=st.integers(2, 6), width=st.floats(30, 120), height=st.floats(30, 120))
@settings(max_examples=8)
def test_every_cell_is_in_one_part_alone_and_parts_are_alike(boats, width, height):
    planned = shared(shapely.box(0, 0, width, height), boats)
    cells = [t for t in planned.survey.targets if t.kind == "cell"]
    assert planned.check.holds
    assert len({t.seq for t in cells}) == len(cells)
    times = np.array([one.time_s for one in planned.revision.sorties])
    # No sharing can balance a difference of one cell.
    cell_s = planned.outcome.time_s / len(cells)
    assert times.max() - times.min() < 0.3 * times.mean() + 4 * cell_s


def test_each_boat_sets_out_from_a_start_of_its_own_that_is_near_its_part():
    starts = FRAME.to_wgs84([(5, 5), (5, 155), (115, 5), (115, 155)]).tolist()
    region = Region(name="x", frame=FRAME, water=BAY)
    fleet = FleetSettings(boats=4, starts=tuple((lon, lat) for lon, lat in starts))
    planned = plan_fleet(region, PRESETS["spyboat"], PlanSettings(cell_m=10.0, fleet=fleet))
    for sortie in planned.revision.sorties:
        lon, lat = FRAME.to_wgs84([(sortie.start.north_m, sortie.start.east_m)])[0]
        assert (lon, lat) == pytest.approx(starts[sortie.boat - 1], abs=1e-6)
    assert planned.legs_s < 1.25 * planned.bound_s


def test_sorties_are_dealt_out_evenly():
    region = Region(name="x", frame=FRAME, water=BAY)
    wishes = PlanSettings(
        cell_m=10.0, sorties=SortieSettings(minutes=10.0), fleet=FleetSettings(boats=2)
    )
    planned = plan_sorties(region, PRESETS["spyboat"], wishes)
    load = [sum(s.time_s for s in planned.revision.sorties if s.boat == b) for b in (1, 2)]
    longest = max(one.time_s for one in planned.revision.sorties)
    assert abs(load[0] - load[1]) <= longest


def test_a_boat_keeps_to_one_harbour_where_there_is_one_for_each():
    region = Region(name="x", frame=FRAME, water=shapely.box(0, 0, 60, 240))
    harbours = tuple(tuple(FRAME.to_wgs84(at).tolist()) for at in ((5.0, 5.0), (5.0, 235.0)))
    wishes = PlanSettings(
        cell_m=12.0, sorties=SortieSettings(minutes=6.0, harbours=harbours),
        fleet=FleetSettings(boats=2),
    )  # fmt: skip
    planned = plan_sorties(region, PRESETS["spyboat"], wishes)
    at = {
        boat: {round(s.start.east_m, -1) for s in planned.revision.sorties if s.boat == boat}
        for boat in (1, 2)
    }
    assert len({east for easts in at.values() for east in easts}) == 2
    assert all(len(easts) == 1 for easts in at.values())


def test_what_cannot_be_shared_is_refused():
    with pytest.raises(PlanError, match="too few for 6 boats"):
        shared(shapely.box(0, 0, 20, 20), 6)
    with pytest.raises(UsageError, match="2 to 50"):
        FleetSettings(boats=1)
    with pytest.raises(UsageError, match="3 boats need 3 starts"):
        FleetSettings(boats=3, starts=((0.0, 0.0),))
    with pytest.raises(UsageError, match="0 m between boats"):
        FleetSettings(boats=3, apart_m=0.0)


def test_unlike_boats_share_by_what_each_can_do():
    """A boat that turns slowly gets less, and all boats finish at about the same time."""
    vessels = tuple(PRESETS[name] for name in ("spyboat", "blueboat", "otter"))
    region = Region(name="x", frame=FRAME, water=BEND)
    fleet = FleetSettings(boats=3, vessels=vessels)
    planned = plan_fleet(region, vessels[0], PlanSettings(cell_m=10.0, fleet=fleet))
    times = [one.time_s for one in planned.revision.sorties]
    assert max(times) < 1.1 * min(times)
    assert planned.legs_s < 1.10 * planned.bound_s
    sizes = {}
    for sortie in planned.revision.sorties:
        part = survey_of(planned.survey, planned.revision, sortie)
        assert part.vessel == vessels[sortie.boat - 1]
        assert check_plan(part, BEND).holds
        sizes[sortie.boat] = sum(t.kind == "cell" for t in part.targets)
    alike = plan_fleet(region, vessels[0], PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=3)))
    slower = [v for v in (2, 3) if sizes[v] < sizes[1]]
    assert slower
    assert alike.bound_s != planned.bound_s


def test_vessels_that_are_not_one_for_each_boat_or_too_slow_are_refused():
    boat = PRESETS["spyboat"]
    with pytest.raises(UsageError, match="3 boats need one vessel for all or 3"):
        FleetSettings(boats=3, vessels=(boat, boat))
    region = Region(name="x", frame=FRAME, water=BAY)
    fleet = FleetSettings(boats=2, vessels=(boat, PRESETS["tianjin"]))
    with pytest.raises(PlanError, match="tianjin"):
        plan_fleet(region, boat, PlanSettings(cell_m=10.0, speed_min_mps=1.4, fleet=fleet))
