"""The places at which a shortest path through water can bend."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    Places = NDArray[np.float64]


def reflex_vertices(water: BaseGeometry) -> Places:
    """The reflex corners (n, 2) of the water's shores: no shortest path bends anywhere else."""
    rings = shapely.get_rings(shapely.orient_polygons(water))
    return np.vstack([_reflex(shapely.get_coordinates(ring)[:-1]) for ring in rings])


def _reflex(ring: Places) -> Places:
    """The reflex corners of the water along an oriented ring."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return ring[before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0]
