"""Write the map of a quantity as a Cloud Optimized GeoTIFF: mean, sd, and probabilities."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.core.frames import LocalFrame
from grebe.io.atomic_write import written_whole
from grebe.mapping.grid import Grid
from grebe.mapping.quantity_map import QuantityMap

if TYPE_CHECKING:
    from numpy.typing import NDArray

NODATA = -9999.0


def write_geotiff(
    path: Path,
    one: QuantityMap,
    frame: LocalFrame,
    exceedances: Mapping[str, NDArray[np.floating]],
) -> None:
    """Write a map north up, in the survey's frame; the file appears only when complete.

    Its bands are `mean`, `sd`, both ends of 95 % intervals that are not symmetric, and one per
    threshold.
    """
    bands = {"mean": one.mean, "sd": one.sd, **one.interval95, **exceedances}
    write_bands(path, one, frame, bands, one.quantity.unit)


def affine(grid: Grid) -> tuple[float, float, float, float, float, float]:
    """Return the transform from column and row to easting and northing.

    Rows run north up; the coefficients are a, b, c, d, e, f.
    """
    step = grid.step_m
    west, north = float(grid.east[0]) - step / 2, float(grid.north[-1]) + step / 2
    return step, 0.0, west, 0.0, -step, north


def write_bands(
    path: Path,
    one: QuantityMap,
    frame: LocalFrame,
    bands: Mapping[str, NDArray[np.floating]],
    unit: str,
    tags: Mapping[str, str] | None = None,
) -> None:
    """Write named fields (rows, columns) on a map's grid; NaN becomes nodata.

    `tags` are those of the file.
    """
    from rasterio.crs import CRS
    from rasterio.errors import RasterioError
    from rasterio.io import MemoryFile
    from rasterio.shutil import copy
    from rasterio.transform import Affine

    grid = one.grid
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "dtype": "float32",
        "count": len(bands),
        "height": len(grid.north),
        "width": len(grid.east),
        "crs": CRS.from_user_input(frame.definition),
        "transform": Affine(*affine(grid)),
        "nodata": NODATA,
    }
    with written_whole(path, RasterioError) as part, MemoryFile() as memory:
        with memory.open(**profile) as dataset:
            for index, (name, field) in enumerate(bands.items(), start=1):
                filled = np.where(np.isfinite(field), field, NODATA)[::-1]
                dataset.write(filled.astype("float32"), index)
                dataset.set_band_description(index, name)
                is_probability = name.startswith("P(")
                dataset.set_band_unit(index, "1" if is_probability else unit or "1")
            dataset.update_tags(
                quantity=one.quantity.key, interpolation=one.method.key, scale=one.scale.name,
                **(tags or {}),
            )  # fmt: skip
        with memory.open() as dataset, MemoryFile(ext=".tif") as optimized:
            copy(dataset, optimized.name, driver="COG", compress="DEFLATE")
            part.write_bytes(optimized.read())
