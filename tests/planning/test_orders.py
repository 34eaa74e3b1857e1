"""The order of the cells: the costs of its legs, its length, and the time that a boat takes."""

import numpy as np
import pytest
import shapely
from conftest import region_of
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.taut import DRAWN_IN, taut_path
from grebe.core.vessel import PRESETS
from grebe.mission.trial import Conditions, simulate
from grebe.planning.cells.mesh import mesh_water
from grebe.planning.paths.network import connect
from grebe.planning.paths.travel import travel_of
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.planning.route.costs import costs_of

BOAT = PRESETS["spyboat"]


def field(water):
    return Region(name="field", frame=region_of([(0, 0), (1, 0), (1, 1)]).frame, water=water)


def length(path):
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def drawn(polygon):
    return shapely.affinity.scale(polygon, 1 - DRAWN_IN, 1 - DRAWN_IN, origin=polygon.centroid)


def test_squares_in_a_row_are_touched_by_a_straight_line():
    squares = [shapely.box(10 * k, -5, 10 * k + 10, 5) for k in range(5)]
    path = taut_path((5.0, 2.0), squares)
    assert length(path) == pytest.approx(35.0 + DRAWN_IN * 5, rel=1e-3)
    assert path[:, 1] == pytest.approx(np.full(6, 2.0), abs=0.1)


def test_a_bank_is_touched_where_light_would_be_reflected():
    """Heron of Alexandria: the shortest path by way of a mirror makes equal angles."""
    bank = shapely.box(-1000, 10, 1000, 30)
    end = shapely.Point(30, 0).buffer(1e-3)
    mirror = drawn(bank).bounds[1]
    path = taut_path((0.0, 0.0), [bank, end])
    assert length(path) == pytest.approx(np.hypot(30, 2 * mirror), rel=1e-3)
    assert path[1] == pytest.approx([15, mirror], abs=0.1)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(1, 12), st.integers(3, 7)),
        min_size=2, max_size=8,
    ),
    st.integers(0, 100),
)  # fmt: skip
def test_moving_a_point_of_a_taut_path_never_shortens_it(spots, seed):
    polygons = [
        shapely.Point(x, y).buffer(r, quad_segs=2).convex_hull
        if corners > 5
        else shapely.Polygon([(x, y), (x + r, y), (x, y + r)])
        for x, y, r, corners in spots
    ]
    path = taut_path((0.0, 0.0), polygons)
    inner = [drawn(polygon) for polygon in polygons]
    assert all(p.distance(shapely.Point(*at)) < 1e-6 for p, at in zip(inner, path[1:], strict=True))
    centred = taut_path((0.0, 0.0), polygons, centred=[True] * len(polygons))
    assert length(path) <= length(centred) + 1e-9
    rng = np.random.default_rng(seed)
    for k, polygon in enumerate(inner, start=1):
        corners = shapely.get_coordinates(polygon)[:-1]
        for share in rng.dirichlet(np.ones(len(corners)), size=20):
            moved = path.copy()
            moved[k] = share @ corners
            assert length(moved) > length(path) - 0.02 * len(path)


def test_a_path_around_a_spit_has_its_exact_length():
    """A wall 1 m thick reaches from one shore to 5 m from the other; the path leads around it."""
    water = shapely.box(0, 0, 40, 20).difference(shapely.box(19.5, 0, 20.5, 15))
    cells = mesh_water(water, 5.0)
    network = connect(cells, water, 5.0)
    places = network.centres
    left = int(np.argmin(np.hypot(*(places - (17.25, 7.5)).T)))
    right = int(np.argmin(np.hypot(*(places - (22.75, 7.5)).T)))
    path = network.around.of(left, right)
    half = np.hypot(*(places[left] - (19.5, 15)))
    assert path == pytest.approx(2 * half + 1, rel=0.01)
    costs = costs_of(network, travel_of(BOAT, (1.0, 2.0), CALM), (0.0, 0.0), returns=False)
    row = slice(costs.starts[left], costs.starts[left + 1])
    seconds = costs.link_s[row][costs.neighbours[row] == right]
    assert seconds == pytest.approx(path / 2, rel=0.1)


@pytest.mark.parametrize("side", [4, 6, 8])
def test_a_board_is_visited_without_a_diagonal(side):
    """K - 1 steps of one cell, which no order can undercut."""
    planned = plan(field(shapely.box(0, 0, 5 * side, 5 * side)), BOAT, PlanSettings(cell_m=5))
    assert planned.outcome.gap == pytest.approx(0.0, abs=1e-9)
    assert planned.outcome.length_m == pytest.approx(5 * (side**2 - 1))


def test_the_lanes_of_a_pattern_are_swept_one_after_the_other():
    water = shapely.box(0, 0, 40, 30)
    for pattern, along in (("rows", 0), ("columns", 1)):
        survey = plan(field(water), BOAT, PlanSettings(cell_m=5, pattern=pattern)).survey
        centres = np.array([target.set.centre for target in survey.targets])
        lanes = np.unique(np.round(centres[:, 1 - along], 3))
        changes = np.sum(np.abs(np.diff(centres[:, 1 - along])) > 1e-6)
        assert changes == len(lanes) - 1
    with pytest.raises(UsageError, match="no pattern"):
        PlanSettings(pattern="spiral")


def test_a_core_keeps_the_boat_near_the_middle_of_each_cell():
    region = field(shapely.box(0, 0, 40, 40))
    whole, core = (plan(region, BOAT, PlanSettings(cell_m=10, core=c)) for c in (1.0, 0.4))
    assert core.check.coverage == pytest.approx(whole.check.coverage)
    assert core.check.holds
    assert core.outcome.time_s > 1.2 * whole.outcome.time_s
    for target in core.survey.targets:
        assert target.set.polygon.area == pytest.approx(16.0)
    cells = shapely.union_all(core.survey.cells)
    assert cells.area == pytest.approx(1600.0)
    with pytest.raises(UsageError, match="A core of"):
        PlanSettings(core=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("vessel", ["spyboat", "blueboat"])
@pytest.mark.parametrize("core", [1.0, 0.5])
def test_a_mission_takes_about_what_its_plan_says(vessel, core):
    boat = PRESETS[vessel]
    bay = shapely.box(0, 0, 60, 60).difference(shapely.box(25, 0, 35, 35))
    plan_settings = PlanSettings(cell_m=6, core=core, speed_min_mps=0.5, speed_max_mps=1.5)
    planned = plan(field(bay), boat, plan_settings)
    survey = planned.survey
    pilot = Controller(boat, survey.sets, corridors=survey.corridors)
    world = Conditions(weather=Weather(current_north_mps=0.1), limit_s=3000)
    flight = simulate(boat, survey.sets, pilot, survey.start.at_rest(), world)
    assert flight.complete
    assert flight.duration_s == pytest.approx(planned.outcome.time_s, rel=0.25)
