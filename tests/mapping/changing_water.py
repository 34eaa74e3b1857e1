"""Readings of synthetic water that changes while a boat sails lanes over it."""

import numpy as np
import shapely

from grebe.mapping.methods.base import Readings
from grebe.mapping.way import earlier

SIDE, SPACING, SPEED = 120.0, 10.0, 1.0
WATER = shapely.box(0, 0, SIDE, SIDE)


def lanes():
    """Places (n, 2) a metre apart, along lanes back and forth and then across; and times [s]."""
    way = []
    for k, east in enumerate(np.arange(5.0, SIDE, SPACING)):
        north = np.arange(2.0, SIDE - 1)
        way += [(n, east) for n in (north if k % 2 == 0 else north[::-1])]
    for k, north in enumerate((30.0, 60.0, 90.0)):
        east = np.arange(2.0, SIDE - 1)
        way += [(north, e) for e in (east[::-1] if k % 2 == 0 else east)]
    places = np.array(way)
    return places, np.arange(len(places)) / SPEED


def waves(places, seed):
    """A smooth random field of variance 1, made of waves some 40 to 120 m long."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(0, 2 * np.pi / 80, (60, 2))
    phases = rng.uniform(0, 2 * np.pi, 60)
    return np.sqrt(2 / 60) * np.cos(places @ waves.T + phases).sum(axis=1)


def slowly(constant_s, seed, parts=20):
    """What a first-order sensor without noise reads each second, from the water at the places of
    the lanes, which are sailed in straight lines; `parts` steps a second.
    """
    places, times = lanes()
    fine = np.linspace(0.0, times[-1], parts * (len(times) - 1) + 1)
    water = waves(np.column_stack([np.interp(fine, times, one) for one in places.T]), seed)
    kept, found = np.exp(-1.0 / (parts * constant_s)), water.copy()
    for i in range(1, len(fine)):
        # Exact for water that is constant within a step, at its mean there.
        found[i] = kept * found[i - 1] + (1 - kept) * 0.5 * (water[i - 1] + water[i])
    return found[::parts]


def read(seed, drift=0.0, lag_s=0.0, constant_s=0.0):
    places, times = lanes()
    rng = np.random.default_rng([seed, 1])
    at = earlier(times, places, lag_s) if lag_s else places
    seen = slowly(constant_s, seed) if constant_s else waves(at, seed)
    values = seen + drift * (times / times[-1] - 0.5) + rng.normal(0, 0.03, len(times))
    return Readings(positions=places, values=values, times=1.6e9 + times)
