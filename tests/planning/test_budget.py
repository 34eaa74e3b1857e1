"""The size of cells whose plan keeps a budget."""

import numpy as np
import pytest
import shapely

from grebe.core.errors import PlanError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.planning.budget import SHARE, affordable_cell_m
from grebe.planning.planner import plan
from grebe.planning.region import Region

LAKE = shapely.box(0, 0, 260, 240) - shapely.box(90, 100, 260, 130) - shapely.box(40, 190, 70, 220)
REGION = Region(name="lake", frame=LocalFrame(origin_lon_deg=3.2, origin_lat_deg=50.6), water=LAKE)


def times(law, quick_by=1.0):
    """Plans whose times follow a law; quick ones take longer by a factor. And what was planned."""
    tried = []

    def spent_s(cell_m, *, quick):
        tried.append((cell_m, quick))
        return law(cell_m) * (quick_by if quick else 1.0)

    return spent_s, tried


@pytest.mark.parametrize("power", [0.8, 1.0, 1.3, 2.0])
@pytest.mark.parametrize("first_m", [2.0, 4.0, 60.0])
def test_a_budget_is_met_in_few_plans(power, first_m):
    spent_s, tried = times(lambda cell_m: 2e4 / cell_m**power)
    cell_m = affordable_cell_m(spent_s, 1800.0, first_m, 300.0)
    assert cell_m in [one for one, _ in tried]
    assert SHARE * 1800 <= spent_s(cell_m, quick=False) <= 1800
    assert len(tried) <= 13


def test_a_budget_is_kept_where_what_a_plan_takes_jumps():
    spent_s, _ = times(lambda cell_m: 2000.0 if cell_m < 7.0 else 1500.0)
    assert affordable_cell_m(spent_s, 1800.0, 3.0, 300.0) == pytest.approx(7.0, rel=0.02)


def test_smaller_cells_beyond_a_jump_are_found_if_they_keep_the_budget():
    def law(cell_m):
        return 1500.0 if cell_m >= 40 else 2000.0 if cell_m > 36 else 1790.0 * 34 / cell_m

    spent_s, tried = times(law)
    cell_m = affordable_cell_m(spent_s, 1800.0, 50.0, 300.0)
    assert 33 < cell_m < 36
    assert SHARE * 1800 <= law(cell_m) <= 1800
    assert len({one for one in tried if not one[1]}) <= 25


@pytest.mark.parametrize("quick_by", [0.85, 0.95, 1.0, 1.2, 1.5])
def test_quick_plans_of_many_cells_neither_exceed_the_budget_nor_leave_it_unused(quick_by):
    spent_s, tried = times(lambda cell_m: 2e4 / cell_m**1.1, quick_by)
    cell_m = affordable_cell_m(spent_s, 9000.0, 2.0, 300.0, many_below_m=5.0)
    assert SHARE * 9000 <= spent_s(cell_m, quick=False) <= 9000
    assert len({one for one in tried if not one[1]}) <= 3


def test_cells_grow_until_the_full_plan_keeps_the_budget():
    def spent_s(cell_m, *, quick):
        return 1e4 / cell_m * (0.5 if quick else 1.0 + (cell_m < 2.2))

    cell_m = affordable_cell_m(spent_s, 9000.0, 2.0, 300.0, many_below_m=5.0)
    assert spent_s(cell_m, quick=False) <= 9000


def test_a_budget_that_nothing_keeps_is_refused():
    spent_s, _ = times(lambda _: 2000.0)
    with pytest.raises(PlanError, match="No plan of this water"):
        affordable_cell_m(spent_s, 1800.0, 3.0, 300.0)


@pytest.mark.parametrize("core", [1.0, 0.3])
@pytest.mark.parametrize("minutes", [10.0, 30.0, 120.0])
def test_a_plan_of_some_minutes_keeps_them_and_uses_nearly_all(minutes, core):
    settings = PlanSettings(cell_m=None, minutes=minutes, core=core)
    outcome = plan(REGION, PRESETS["spyboat"], settings).outcome
    assert 0.9 * 60 * minutes <= outcome.time_s <= 60 * minutes


def test_a_plan_that_leaves_much_of_its_time_says_so_and_why():
    settings = PlanSettings(cell_m=None, minutes=12, pattern="rows")
    planned = plan(REGION, PRESETS["spyboat"], settings)
    share = planned.outcome.time_s / 720
    assert share < 0.9
    assert any(f"uses {100 * share:.0f} % of the time" in note for note in planned.notes)


def test_a_free_direction_affords_no_larger_cells_than_north():
    north, free = (
        plan(REGION, PRESETS["spyboat"], PlanSettings(cell_m=None, minutes=15, angle_deg=angle))
        for angle in (0.0, None)
    )
    assert free.outcome.cell_m <= north.outcome.cell_m
    assert free.outcome.time_s <= 900
    assert np.isfinite(free.outcome.time_s)
