"""Recognise a place at sea: swapping longitude and latitude often ends there.

`land.bin` holds a bit for each degree of the globe, set if there is land within a degree
(`tools/land_mask.py` made it, from NOAA's GLOBE, public domain).
"""

from __future__ import annotations

from importlib import resources

import numpy as np


def is_near_land(lon_deg: float, lat_deg: float) -> bool:
    """Return whether there is land within about a degree of a place."""
    bits = (resources.files("grebe.io.readers") / "land.bin").read_bytes()
    near = np.unpackbits(np.frombuffer(bits, np.uint8)).reshape(180, 360)
    row = min(int(90.0 - lat_deg), 179)
    column = int(lon_deg + 180.0) % 360
    return bool(near[row, column])


def sea_warning(lon_deg: float, lat_deg: float) -> str:
    """Return a warning about a region at sea; empty for one on land, where lakes are."""
    if is_near_land(lon_deg, lat_deg):
        return ""
    warning = f"the region is at {lat_deg:.3f} N, {lon_deg:.3f} E, far from any land"
    if abs(lon_deg) <= 90 and is_near_land(lat_deg, lon_deg):
        return (
            f"{warning}, and {lon_deg:.3f} N, {lat_deg:.3f} E is near land: are longitude and "
            "latitude swapped?"
        )
    return f"{warning}; check its coordinates"
