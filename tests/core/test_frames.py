"""WGS 84 to local metres and back."""

import numpy as np
import pytest
from conftest import FRAME
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame

metres = st.floats(-5000, 5000)


@given(metres, metres)
def test_round_trip_is_exact_to_a_micrometre(north, east):
    back = FRAME.to_local(FRAME.to_wgs84((north, east)))
    assert back == pytest.approx((north, east), abs=1e-6)


def test_north_is_first_and_points_north():
    north = FRAME.to_wgs84((1000.0, 0.0))
    assert north[1] > FRAME.origin_lat_deg
    assert north[0] == pytest.approx(FRAME.origin_lon_deg)


@given(metres, metres)
def test_distances_are_those_of_the_ellipsoid(north, east):
    lon, lat = FRAME.to_wgs84((north, east))
    _, _, geodesic = Geod(ellps="WGS84").inv(
        FRAME.origin_lon_deg, FRAME.origin_lat_deg, float(lon), float(lat)
    )
    assert geodesic == pytest.approx(np.hypot(north, east), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("lon", "lat"), [(float("nan"), 0.0), (0.0, 89.5), (200.0, 0.0)])
def test_an_origin_that_is_no_place_is_refused(lon, lat):
    with pytest.raises(InputError):
        LocalFrame(origin_lon_deg=lon, origin_lat_deg=lat)
