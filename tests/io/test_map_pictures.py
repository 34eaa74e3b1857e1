"""The picture of a map: its title is above all else, whatever the shape of the lake."""

import numpy as np
import pytest
import shapely

from grebe.core.frames import LocalFrame
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper
from grebe.report.map_figures import map_figure


@pytest.mark.parametrize(("north_m", "east_m"), [(60.0, 100.0), (180.0, 300.0), (100.0, 30.0)])
def test_the_title_of_a_picture_covers_no_title_of_its_maps(north_m, east_m):
    water = shapely.box(0, 0, north_m, east_m)
    rng = np.random.default_rng(3)
    positions = rng.uniform(0, 1, (40, 2)) * [north_m, east_m]
    values = {"temperature_degc": 15 + 0.01 * positions[:, 0] + rng.normal(0, 0.01, 40)}
    samples = Samples.of(
        times=1.7e9 + np.arange(40.0), positions=positions, values=values, quantities=BUILTIN
    )
    frame = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
    survey = Survey(name="A lake", frame=frame, water=water, targets=())
    grid = make_grid(water, 10.0)
    one = Mapper(water, grid).map_quantity(
        BUILTIN["temperature_degc"],
        positions,
        values["temperature_degc"],
        samples.flags["temperature_degc"],
    )
    figure = map_figure(survey, one, samples)
    figure.draw_without_rendering()
    above = figure._suptitle.get_window_extent()
    for axes in figure.axes[:2]:
        for where in ("left", "center"):
            title = axes.get_title(loc=where)
            if title:
                label = {"left": axes._left_title, "center": axes.title}[where]
                assert label.get_window_extent().y1 <= above.y0
