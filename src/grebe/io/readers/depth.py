"""Read a bathymetry: the depth of the water at any place, as a drift of the map's mean."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import distance_transform_edt

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame
from grebe.mapping.covariance.drift import DriftFunction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

MOST_PIXELS = 50_000_000


def read_depth(path: Path, frame: LocalFrame) -> DriftFunction:
    """Return the depth in the first band of a raster as a function of local positions (n, 2).

    Between pixels it is bilinear. A pixel without a value takes that of the nearest pixel that has
    one. Raises `InputError` if the file is not a raster, has no CRS, no values, or is too large.
    """
    import rasterio
    from rasterio.errors import RasterioError
    from rasterio.warp import transform

    try:
        with rasterio.open(path) as file:
            if file.crs is None:
                raise InputError(f"{path} does not say which coordinates it uses (no CRS).")
            if file.width * file.height > MOST_PIXELS:
                raise InputError(
                    f"{path} has more than {MOST_PIXELS:,} pixels; cut it to the lake."
                )
            band = file.read(1, masked=True).astype(float).filled(np.nan)
            crs, inverse = file.crs, ~file.transform
    except (RasterioError, OSError) as error:
        raise InputError(f"{path} cannot be read as a raster: {error}.") from None
    filled = _filled(path, band)
    rows, columns = (np.arange(side) + 0.5 for side in band.shape)
    depth = RegularGridInterpolator((rows, columns), filled)

    def at(positions: Array) -> Array:
        lon, lat = frame.to_wgs84(positions).T
        x, y = (np.array(one) for one in transform("EPSG:4326", crs, lon, lat))
        column = inverse.a * x + inverse.b * y + inverse.c
        row = inverse.d * x + inverse.e * y + inverse.f
        inside = np.column_stack(
            [np.clip(row, rows[0], rows[-1]), np.clip(column, columns[0], columns[-1])]
        )
        return np.asarray(depth(inside))[:, None]

    return at


def _filled(path: Path, band: Array) -> Array:
    """Return the band with each gap filled from the nearest pixel that has a value."""
    missing = ~np.isfinite(band)
    if missing.all() or min(band.shape) < 2:
        raise InputError(f"{path} holds no depths.")
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return band[tuple(np.asarray(nearest))]
