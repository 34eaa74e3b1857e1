"""Rows at a place that a receiver repeated while the boat went on are left out."""

import numpy as np
import pytest

from grebe.io.readers.held_places import held_places
from grebe.io.readers.track import read_track

N = 300
T = np.arange(float(N))
ALONG = np.column_stack([1.2 * T, np.zeros(N)])


def held(first, end, places=ALONG):
    places = places.copy()
    places[first:end] = places[first]
    return places


def test_places_repeated_while_the_boat_went_on_are_found():
    assert np.flatnonzero(held_places(held(100, 160), T, 10.0)).tolist() == [*range(101, 160)]


def test_a_boat_that_lay_still_keeps_its_rows():
    places = ALONG.copy()
    places[100:160] = places[100]
    places[160:] -= ALONG[159] - ALONG[100]
    assert not held_places(places, T, 10.0).any()


@pytest.mark.parametrize("every", [2, 5, 10])
def test_a_receiver_slower_than_the_logger_is_not_lost(every):
    places = ALONG[(np.arange(N) // every) * every]
    assert not held_places(places, T, 10.0).any()
    assert held_places(held(100, 200, places), T, 10.0)[101:199].all()


def test_places_to_a_few_digits_are_not_lost():
    places = np.round(ALONG / 11.0) * 11.0
    assert not held_places(places, T, 10.0).any()


def test_a_jump_that_no_boat_makes_is_another_fault():
    places = ALONG.copy()
    places[100:120] = [0.0, 5000.0]
    assert not held_places(places, T, 10.0).any()


def test_a_track_says_which_rows_it_left_out(tmp_path):
    lon = 3 + np.where((T >= 100) & (T < 160), 100, T) * 1.7e-5
    lines = [
        f"{1000 + t:.0f},50.0,{x:.7f},{20 + 0.01 * t:.2f}" for t, x in zip(T, lon, strict=True)
    ]
    path = tmp_path / "track.csv"
    path.write_text("\n".join(["time,lat,lon,Temp °C", *lines]))
    track = read_track(path)
    assert len(track.lonlat) == N - 59
    assert np.all((track.times <= 1100) | (track.times >= 1160))
    said = "59 rows at a place that was repeated while the boat went on (from row 102 of the"
    assert any(one.startswith(said) for one in track.notes)
