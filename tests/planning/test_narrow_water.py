"""Rivers and arms: water narrower than a cell is planned completely, or the plan says otherwise."""

import numpy as np
import pytest
import shapely
from conftest import region_of

from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.planning.cells.convex import convex_growth
from grebe.planning.cells.mesh import mesh_water
from grebe.planning.check import check_plan
from grebe.planning.planner import plan_survey
from grebe.planning.region import water_of
from grebe.workflow.plans import plan_region

BOAT = PRESETS["blueboat"]


def river(width_m: float, length_m: float = 600.0):
    """A river of bends so gentle that the shore margin rounds them within millimetres."""
    along = np.arange(0.0, length_m, 20.0)
    north = 20 * np.sin(along / 100)
    one, other = (np.column_stack([north + off, along]).tolist() for off in (0.0, width_m))
    return region_of([*one, *other[::-1]])


def settings(cell_m: float, margin_m: float = 1.0) -> PlanSettings:
    return PlanSettings(
        cell_m=cell_m, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=margin_m
    )


@pytest.mark.parametrize("cell_m", [20.0, 30.0])
def test_a_river_narrower_than_its_cells_is_planned_from_end_to_end(cell_m):
    survey = plan_survey(river(18.0), BOAT, settings(cell_m))
    check = check_plan(survey, water_of(survey))
    assert check.holds
    assert check.coverage > 0.99


def test_slivers_that_are_kept_leave_cells_disjoint_within_the_water():
    water = shapely.Polygon(river(18.0).water).buffer(-1.0, quad_segs=4)
    cells = [one.footprint for one in mesh_water(water, 20.0, keeps_slivers=True)]
    left_out = [one.footprint for one in mesh_water(water, 20.0)]
    assert sum(one.area for one in left_out) < sum(one.area for one in cells)
    assert sum(one.area for one in cells) == pytest.approx(water.area, rel=1e-6)
    assert shapely.union_all(cells, grid_size=1e-7).area == pytest.approx(water.area, rel=1e-6)


def test_a_piece_grows_into_its_neighbour_as_far_as_it_stays_convex():
    square = shapely.box(0, 0, 1, 1)
    wedge = shapely.Polygon([(1, 0), (1, 1), (2, 1.5), (2, -0.5)])
    assert convex_growth(square, wedge).equals(shapely.box(0, 0, 2, 1))
    assert convex_growth(square, shapely.box(1, 0.2, 2, 0.8)) is None
    assert convex_growth(square, shapely.box(3, 3, 4, 4)) is None


def test_water_too_narrow_for_any_target_is_refused_in_one_sentence():
    with pytest.raises(PlanError, match="too narrow for cells of 20 m"):
        plan_survey(river(18.0, length_m=1200.0), BOAT, settings(20.0, margin_m=8.6))


def test_much_water_outside_the_cells_is_reported():
    arm_of_specks = [(0, 0), (0, 40), (40, 40), (40, 20.7), (640, 20.7), (640, 20), (40, 20)]
    planned = plan_region(region_of([*arm_of_specks, (40, 0)]), BOAT, settings(20.0, 0.0))
    assert planned.check.coverage < 0.85
    assert [text for text in planned.notes if text.startswith("the cells cover ")]
    whole = plan_region(region_of([(0, 0), (0, 40), (40, 40), (40, 0)]), BOAT, settings(20.0))
    assert not whole.notes
