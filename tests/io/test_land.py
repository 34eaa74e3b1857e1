"""Swapped longitude and latitude are reported, and real lakes cause no warning."""

import json

import pytest
import shapely

from grebe.io.readers.land import is_near_land, sea_warning
from grebe.workflow.plans import read_region

# Longitude, latitude: large lakes, a lagoon, a lake on an island, lakes far north and south.
LAKES = {
    "Geneva": (6.5, 46.45),
    "Victoria": (33.0, -1.0),
    "Superior": (-87.5, 47.7),
    "Baikal": (107.5, 53.5),
    "Titicaca": (-69.3, -15.9),
    "Caspian Sea": (50.5, 42.0),
    "Lagoon of Venice": (12.3, 45.4),
    "Thingvallavatn": (-21.15, 64.18),
    "Taupo": (175.9, -38.8),
    "Lac du Heron": (3.171, 50.636),
    "Crater lake of Sao Miguel": (-25.32, 37.77),
}


@pytest.mark.parametrize("name", LAKES)
def test_no_lake_is_taken_for_the_sea(name):
    assert sea_warning(*LAKES[name]) == ""


@pytest.mark.parametrize("place", [(-40.0, 40.0), (-140.0, -40.0), (70.0, -30.0), (-179.9, 0.5)])
def test_a_region_in_the_middle_of_an_ocean_is_reported(place):
    assert not is_near_land(*place)
    assert "far from any land" in sea_warning(*place)


@pytest.mark.parametrize("place", [(-180.0, 90.0), (180.0, -90.0), (180.0, 0.0)])
def test_the_edges_of_the_globe_are_places_too(place):
    assert isinstance(is_near_land(*place), bool)


def test_a_swapped_lake_that_ends_at_sea_is_named_with_its_place(tmp_path):
    """A lake in Labrador at 51 N, 55 W, with swapped coordinates, ends in the southern ocean."""
    path = tmp_path / "lake.geojson"
    swapped = sea_warning(51.0, -55.0)
    assert "-55.000 N, 51.000 E" in swapped
    assert "swapped?" in swapped
    path.write_text(json.dumps(shapely.geometry.mapping(shapely.box(51.0, -55.01, 51.01, -55.0))))
    _, notes = read_region(path)
    assert [note for note in notes if "longitude and latitude swapped?" in note]
