"""Coasts with very many vertices are simplified, and never onto land."""

import numpy as np
import pytest
import shapely
from conftest import FRAME
from hypothesis import assume, given
from hypothesis import strategies as st

from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.planning.planner import MANY_VERTICES, plan
from grebe.planning.region import Region, coarsened


def coast(vertices, radius, seed, roughness=0.12, centre=(0.0, 0.0)):
    """A fractal shore: the logarithm of its radius has a spectrum that falls as k^-1.25."""
    rng = np.random.default_rng(seed)
    k = np.arange(1, min(4000, vertices // 4))
    waves = (
        roughness
        * k**-1.25
        * rng.normal(size=len(k))
        * np.exp(1j * rng.uniform(0, 2 * np.pi, len(k)))
    )
    spectrum = np.zeros(vertices, complex)
    spectrum[k] = waves
    reach = radius * np.exp(np.real(np.fft.ifft(spectrum)) * vertices)
    angle = np.linspace(0, 2 * np.pi, vertices, endpoint=False)
    return np.column_stack([centre[0] + reach * np.cos(angle), centre[1] + reach * np.sin(angle)])


def lake(vertices, islands, seed=1):
    around = [(700 * np.cos(0.8 * i), 700 * np.sin(0.8 * i)) for i in range(islands)]
    holes = [coast(vertices // 40, 120, seed + 10 + i, centre=c) for i, c in enumerate(around)]
    return Region(
        name="coast", frame=FRAME, water=shapely.Polygon(coast(vertices, 1500, seed), holes)
    )


@given(st.integers(0, 10_000), st.floats(0.2, 60.0), st.integers(0, 4))
def test_the_coarser_coast_lies_within_the_water_and_near_its_shore(seed, tolerance_m, islands):
    region = lake(2_000, islands, seed)
    assume(region.water.is_valid)
    drawn, notes = coarsened(region, tolerance_m)
    assert shapely.covers(region.water, drawn.water)
    if notes:
        assert shapely.get_num_coordinates(drawn.water) < shapely.get_num_coordinates(region.water)
        assert "this gives up" in notes[0]


def test_a_plain_lake_is_left_as_it_is():
    region = lake(2_000, 2)
    settings = PlanSettings(cell_m=150.0, speed_min_mps=0.5)
    survey = plan(region, PRESETS["blueboat"], settings).survey
    assert survey.water.equals(shapely.normalize(region.water))


@pytest.mark.slow
def test_a_coast_of_300_000_vertices_is_planned_on_the_water():
    region = lake(250_000, 8)
    assert shapely.get_num_coordinates(region.water) > 290_000
    settings = PlanSettings(cell_m=60.0, speed_min_mps=0.5, shore_margin_m=1.0)
    planned = plan(region, PRESETS["blueboat"], settings)
    assert "outline was simplified" in planned.notes[0]
    assert shapely.get_num_coordinates(planned.survey.water) < MANY_VERTICES
    assert shapely.covers(region.water, planned.survey.water)
    assert planned.check.outside_m2 < 1e-3
    assert planned.survey.coverage > 0.98
