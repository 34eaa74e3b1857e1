"""Concave lakes with islands: every cell once, every corridor in the water."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import CHINA, DATA, needs_outlines, needs_tracks, region_of
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError
from grebe.core.plan_settings import SHAPES, PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.readers.outline import read_outline
from grebe.mission.trial import Conditions, simulate
from grebe.planning.cells.convex import convex_pieces, is_convex
from grebe.planning.cells.mesh import mesh_water
from grebe.planning.check import check_plan
from grebe.planning.paths.network import connect
from grebe.planning.paths.travel import travel_of
from grebe.planning.planner import plan
from grebe.planning.region import Region, clean_region, navigable_water
from grebe.planning.route.bounds import lower_bound_m
from grebe.planning.route.costs import costs_of, order_cost
from grebe.planning.route.polish import polished

BOAT = PRESETS["spyboat"]
BAY = (-1050.0, -1130.0)  # of Allequash, its western end


@st.composite
def lakes(draw):
    """A star-shaped lake of 60 to 140 m with up to three islands."""
    corners = draw(st.integers(5, 14))
    radii = [draw(st.floats(25, 70)) for _ in range(corners)]
    angles = 2 * math.pi * np.arange(corners) / corners
    shore = shapely.Polygon(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))
    for _ in range(draw(st.integers(0, 3))):
        place = shapely.Point(draw(st.floats(-40, 40)), draw(st.floats(-40, 40)))
        shore = shore.difference(place.buffer(draw(st.floats(2, 9)), quad_segs=2))
    parts = [p for p in shapely.get_parts(shore) if isinstance(p, shapely.Polygon)]
    return max(parts, key=lambda part: part.area)


def region_with(water):
    ring = region_of([(0, 0), (1, 0), (1, 1)])
    return Region(name="lake", frame=ring.frame, water=water)


@settings(deadline=None, max_examples=40)
@given(lakes(), st.sampled_from(SHAPES), st.floats(5, 12), st.floats(0, 90))
def test_any_lake_is_planned_within_its_water(water, shape, cell, angle):
    planned = plan(
        region_with(water), BOAT, PlanSettings(cell_m=cell, shape=shape, angle_deg=angle)
    )
    check, survey = planned.check, planned.survey
    assert check.outside_m2 == 0.0
    assert check.overlap_m2 < 1e-3
    assert check.coverage > 0.9
    assert check.start_afloat
    assert len(survey.corridors) == len(survey.targets)
    assert planned.outcome.gap > -1e-9


@settings(deadline=None, max_examples=40)
@given(lakes(), st.sampled_from(SHAPES), st.floats(4, 12), st.floats(-90, 90))
def test_cells_are_convex_disjoint_and_cover_the_lake(water, shape, cell, angle):
    cells = mesh_water(water, cell, shape=shape, angle_deg=angle)
    union = shapely.union_all([c.footprint for c in cells], grid_size=1e-7)
    # Only pieces that are thinner than a hand's breadth and join no neighbour may be missing.
    assert shapely.symmetric_difference(union, water, grid_size=1e-7).area < 5e-3 * water.area
    assert sum(c.footprint.area for c in cells) == pytest.approx(union.area, rel=1e-5)
    assert all(is_convex(c.footprint) for c in cells)


@given(lakes())
def test_convex_pieces_are_convex_and_make_up_the_whole(water):
    pieces = convex_pieces(water)
    assert all(is_convex(piece) for piece in pieces)
    assert sum(piece.area for piece in pieces) == pytest.approx(water.area)


@settings(deadline=None, max_examples=20)
@given(lakes(), st.integers(0, 5))
def test_polishing_keeps_every_cell_and_counts_what_it_saves(water, seed):
    cells = mesh_water(water, 8.0)
    network = connect(cells, water, 8.0)
    weather = Weather(current_north_mps=0.3 * (seed % 2))
    travel = travel_of(BOAT, (1.0, 2.0), weather)
    costs = costs_of(network, travel, (0.0, 0.0), returns=seed % 3 == 0)
    order = np.random.default_rng(seed).permutation(len(cells))
    better, seconds = polished(costs, order, 200, seed)
    assert sorted(better) == list(range(len(cells)))
    start = len(cells)
    assert order_cost(costs, np.concatenate([[start], better])) == pytest.approx(seconds)
    assert seconds <= order_cost(costs, np.concatenate([[start], order])) + 1e-6


def test_the_parity_bound_of_a_chessboard_with_an_excess():
    """A 3 x 3 board has five squares of one colour and four of the other; without its middle
    square, four and four; without two corners of the larger colour, three and four."""
    cells = mesh_water(shapely.box(0, 0, 30, 30), 10)
    assert lower_bound_m(cells, "square", 10) == pytest.approx(80.0)
    dark = [c for c in cells if (c.row + c.column) % 2 == 0]
    light = [c for c in cells if (c.row + c.column) % 2 == 1]
    # Five of one colour, one of the other: an excess of four forces three diagonals.
    assert lower_bound_m([*dark, light[0]], "square", 10) >= 10 * (5 + 3 * (2**0.5 - 1))


def test_a_current_changes_the_best_order():
    """Remark 12: in a strong current the order differs from the one in still water."""
    region = region_with(shapely.box(0, 0, 60, 40))
    still = plan(region, BOAT, PlanSettings(cell_m=5))
    strong = Weather(current_east_mps=1.2)
    flowing = plan(region, BOAT, PlanSettings(cell_m=5, weather=strong))
    travel = travel_of(BOAT, (1.0, 2.0), strong)

    def seconds(planned):
        start = planned.survey.start
        centres = [target.set.centre for target in planned.survey.targets]
        return travel.path_s(np.array([(start.north_m, start.east_m), *centres]))

    order = [[t.set.centre for t in p.survey.targets] for p in (still, flowing)]
    assert order[0] != order[1]
    assert seconds(flowing) < 0.97 * seconds(still)


def test_weather_beyond_the_boat_s_means_is_refused():
    region = region_with(shapely.box(0, 0, 40, 40))
    with pytest.raises(PlanError, match="wait for better weather"):
        plan(region, BOAT, PlanSettings(weather=Weather(current_north_mps=3.0)))


@pytest.mark.parametrize("budget", [{"minutes": 10.0}, {"energy_wh": 12.0}])
def test_a_budget_chooses_the_cells(budget):
    region = region_with(shapely.box(0, 0, 60, 60))
    numbers = plan(region, BOAT, PlanSettings(cell_m=None, **budget)).outcome
    share = numbers.time_s / 600 if "minutes" in budget else numbers.energy_wh / budget["energy_wh"]
    assert 0.6 < share <= 1.02


def test_returning_ends_where_it_began():
    region = region_with(shapely.box(0, 0, 40, 40))
    survey = plan(region, BOAT, PlanSettings(cell_m=10, returns=True)).survey
    place = shapely.Point(survey.start.north_m, survey.start.east_m)
    assert survey.targets[-1].set.polygon.distance(place) < 15.0


def test_no_go_zones_and_the_margin_are_kept():
    region = region_with(shapely.box(0, 0, 60, 60))
    zone = shapely.box(20, 20, 40, 40)
    planned = plan(region, BOAT, PlanSettings(cell_m=6, shore_margin_m=2), no_go=[zone])
    water = shapely.box(2, 2, 58, 58).difference(zone.buffer(1.9))
    assert check_plan(planned.survey, water).outside_m2 < 0.1
    assert planned.survey.no_go == (zone,)


def test_a_margin_that_leaves_no_water_is_reported():
    region = region_with(shapely.box(0, 0, 20, 20))
    with pytest.raises(PlanError, match="Nothing of the region"):
        navigable_water(region, (), 11.0)


def test_two_basins_with_land_between_them_are_reported():
    basins = shapely.box(0, 0, 40, 40).union(shapely.box(0, 41, 40, 60))
    neck = shapely.box(18, 39, 20, 42)
    water, notes = navigable_water(region_with(basins.union(neck)), (), 1.5)
    assert water.area < 1600
    assert "cannot be reached" in notes[0]


def test_the_checker_finds_land_under_a_path():
    """A plan in a shuffled order crosses the land, and the check reports the area."""
    bay = shapely.box(0, 0, 40, 40).difference(shapely.box(10, 15, 40, 25))
    survey = plan(region_with(bay), BOAT, PlanSettings(cell_m=5)).survey
    far = max(survey.targets, key=lambda t: t.set.centre[0] + t.set.centre[1])
    near = max(survey.targets, key=lambda t: t.set.centre[0] - t.set.centre[1])
    crossed = replace(survey, corridors=(), targets=(replace(near, seq=1), replace(far, seq=2)))
    assert check_plan(crossed, bay).outside_m2 > 10.0
    assert check_plan(survey, bay).outside_m2 == 0.0


def real(name):
    outline = read_outline(DATA / "regions" / f"{name}.geojson")
    return clean_region(outline.geometry, outline.name)


@needs_outlines
@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("name", "cell"), [("alamillo", 5), ("crystal", 15), ("allequash", 25)])
def test_real_lakes_are_planned_within_their_water(name, cell, shape):
    planned = plan(real(name), BOAT, PlanSettings(cell_m=cell, shape=shape, shore_margin_m=1.0))
    assert planned.check.outside_m2 == 0.0
    assert planned.check.coverage > 0.97
    cells = [t for t in planned.survey.targets if t.kind == "cell"]
    assert len({t.set.centre for t in cells}) == len(cells)


@needs_outlines
@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("count", "gap"), [(100, 0.02), (1000, 0.03)])
@pytest.mark.parametrize("name", ["alamillo", "crystal", "allequash"])
def test_ways_over_real_lakes_are_nearly_as_short_as_can_be(name, count, gap, shape):
    region = real(name)
    cell_m = math.sqrt(region.water.area / count)
    planned = plan(region, BOAT, PlanSettings(cell_m=cell_m, shape=shape))
    assert 0 <= planned.outcome.gap < gap
    assert planned.check.holds


@needs_tracks
@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_the_hull_of_a_real_track_is_planned(shape):
    outline = read_outline(CHINA)
    region = clean_region(outline.geometry, outline.name)
    planned = plan(region, BOAT, PlanSettings(cell_m=10, shape=shape, angle_deg=None))
    assert planned.check.outside_m2 == 0.0
    assert planned.check.coverage > 0.97
    assert planned.outcome.gap < 0.04


def bay_of(region):
    """The part of a lake within 130 m of a point in one of its bays."""
    around = shapely.Point(*BAY).buffer(130)
    parts = shapely.get_parts(shapely.intersection(region.water, around, grid_size=1e-6))
    return replace(region, water=max(parts, key=shapely.area))


@needs_outlines
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cell", "current"),
    [
        ("alamillo", 8, 0.3),
        ("alamillo", 5, 0.0),
        ("alamillo", 3, 0.3),
        ("allequash", 10, 0.0),
        ("allequash", 10, 0.3),
    ],
)
def test_a_real_lake_is_surveyed_without_touching_land(name, cell, current):
    """Alamillo has nine islands; Allequash is cut down to one bay."""
    region = real(name) if name == "alamillo" else bay_of(real(name))
    survey = plan(region, BOAT, PlanSettings(cell_m=cell, shore_margin_m=1.0)).survey
    pilot = Controller(BOAT, survey.sets, corridors=survey.corridors)
    weather = Weather(current_north_mps=0.8 * current, current_east_mps=-0.6 * current)
    world = Conditions(weather=weather, limit_s=5000)
    flight = simulate(BOAT, survey.sets, pilot, survey.start.at_rest(), world)
    assert flight.complete
    places = shapely.points(np.array(flight.track)[:, 1:3])
    assert shapely.covers(region.water, places).all()
