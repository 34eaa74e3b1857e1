"""A file of closed areas is read again when it changes, and a broken one stops nothing."""

import os
from datetime import UTC, datetime

import numpy as np
import pytest
import shapely
from conftest import FRAME

from grebe.core.dynamics import CALM
from grebe.core.errors import InputError
from grebe.core.events import Estimate
from grebe.core.survey import Survey
from grebe.workflow.closures import Closures

SURVEY = Survey(name="pond", frame=FRAME, water=shapely.box(0, 0, 60, 60), targets=())


class Mission:
    def __init__(self):
        self.closed = []

    def close(self, zones, why):
        self.closed.append((zones, why))


def write(path, *boxes, at):
    """Write boxes in local metres, with the file's time set to a given second."""
    features = []
    for box in boxes:
        ring = FRAME.to_wgs84(np.array(shapely.box(*box).exterior.coords))
        text = shapely.to_geojson(shapely.Polygon(ring.tolist()))
        features.append(f'{{"type":"Feature","properties":{{}},"geometry":{text}}}')
    path.write_text(f'{{"type":"FeatureCollection","features":[{",".join(features)}]}}')
    os.utime(path, (at, at))


def estimate(seconds):
    now = datetime(2026, 5, 1, tzinfo=UTC)
    return Estimate(time=now, elapsed_s=seconds, state=(0.0,) * 6, weather=CALM)


@pytest.fixture
def watched(tmp_path):
    said, mission = [], Mission()
    closures = Closures(path=tmp_path / "closed.geojson", survey=SURVEY, say=said.append)
    closures.begin(mission)
    return closures, mission, said


def test_what_appears_and_what_is_added_is_closed_once(watched):
    closures, mission, said = watched
    closures(estimate(0.0))
    assert mission.closed == []
    write(closures.path, (10, 10, 20, 20), at=1)
    closures(estimate(0.5))
    assert mission.closed == []
    closures(estimate(1.0))
    closures(estimate(2.0))
    [(zones, why)] = mission.closed
    assert zones[0].area == pytest.approx(100.0, rel=1e-3)
    assert why == "closed.geojson: an area of 100 m2 is closed"
    write(closures.path, (10, 10, 20, 20), (30, 30, 40, 50), at=2)
    closures(estimate(3.0))
    assert [round(sum(z.area for z in zones)) for zones, _ in mission.closed] == [100, 200]
    assert said == []


def test_a_file_that_is_half_written_is_read_at_the_next_look(watched):
    closures, mission, said = watched
    write(closures.path, (10, 10, 20, 20), at=1)
    whole = closures.path.read_text()
    closures.path.write_text(whole[:40])
    closures(estimate(0.0))
    closures(estimate(1.0))
    assert len(said) == 1
    assert "closed.geojson cannot be read" in said[0]
    closures.path.write_text(whole)
    closures(estimate(2.0))
    assert len(mission.closed) == 1


def test_an_area_outside_the_water_closes_nothing_and_is_reported(watched):
    closures, mission, said = watched
    write(closures.path, (500, 500, 520, 520), at=1)
    closures(estimate(0.0))
    assert mission.closed == []
    assert "from the water" in said[0]


def test_a_second_mission_gets_the_areas_closed_before(watched):
    closures, first, _ = watched
    write(closures.path, (10, 10, 20, 20), at=1)
    closures(estimate(100.0))
    second = Mission()
    closures.begin(second)
    closures(estimate(0.0))
    assert len(first.closed) == len(second.closed) == 1


def test_a_file_that_is_wrong_before_the_boat_sets_out_is_refused(tmp_path):
    path = tmp_path / "closed.geojson"
    path.write_text("{")
    with pytest.raises(InputError, match=r"closed\.geojson"):
        Closures(path=path, survey=SURVEY, say=lambda _: None)


def test_closed_areas_in_metres_are_refused_with_what_can_be_done_about_it(watched):
    closures, _, _ = watched
    metres = shapely.to_geojson(shapely.box(500_000, 5_000_000, 500_100, 5_000_100))
    closures.path.write_text(metres)
    with pytest.raises(InputError, match="name its coordinates itself") as refused:
        Closures(path=closures.path, survey=SURVEY, say=print)
    assert refused.value.settings == ()
