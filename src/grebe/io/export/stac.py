"""Write the STAC item of a set of maps, for spatial catalogues.

STAC 1.1.0, with the projection extension; the assets are beside the item.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely

from grebe.io.atomic_write import write_text_whole
from grebe.io.export.catalogue import CatalogueEntry, time_text

ITEM_NAME = "item.json"
EXTENSIONS = ("https://stac-extensions.github.io/projection/v2.0.0/schema.json",)
MEDIA = {
    ".tif": ("image/tiff; application=geotiff; profile=cloud-optimized", "data"),
    ".nc": ("application/netcdf", "data"),
    ".gpkg": ("application/geopackage+sqlite3", "data"),
    ".csv": ("text/csv", "data"),
    ".png": ("image/png", "overview"),
}


@dataclass(frozen=True, kw_only=True)
class Asset:
    """A file of the set: `title`, and for a raster its `bands`, (name, unit) each."""

    path: Path
    title: str
    bands: Sequence[tuple[str, str]] = ()


def write_stac_item(
    path: Path,
    entry: CatalogueEntry,
    assets: Sequence[Asset],
    projection: Mapping[str, Any],
) -> None:
    """Write the item; `projection` holds what all rasters share, by the projection extension."""
    properties: dict[str, Any] = {
        "title": entry.title,
        "description": entry.summary,
        "created": time_text(entry.created_s),
        "keywords": list(entry.keywords),
        "gsd": entry.resolution_m,
        **projection,
        "datetime": time_text((entry.first_s + entry.last_s) / 2),
        "start_datetime": time_text(entry.first_s),
        "end_datetime": time_text(entry.last_s),
    }
    if "license" in entry.credits:
        properties["license"] = entry.credits["license"]
    west, south, east, north = entry.outline.bounds
    item = {
        "type": "Feature",
        "stac_version": "1.1.0",
        "stac_extensions": list(EXTENSIONS),
        "id": entry.identifier,
        "geometry": shapely.geometry.mapping(shapely.geometry.polygon.orient(entry.outline)),
        "bbox": [west, south, east, north],
        "properties": properties,
        # A link to itself would have to be absolute, and its final address is not known yet.
        "links": [],
        "assets": {one.path.name: _asset(one) for one in assets if one.path.suffix in MEDIA},
    }
    write_text_whole(path, json.dumps(item, indent=1, ensure_ascii=False) + "\n")


def _asset(one: Asset) -> dict[str, Any]:
    media, role = MEDIA[one.path.suffix]
    made: dict[str, Any] = {
        "href": f"./{one.path.name}",
        "type": media,
        "title": one.title,
        "roles": [role],
    }
    if one.bands:
        made["bands"] = [
            {"name": name, "description": name, **({"unit": unit} if unit else {})}
            for name, unit in one.bands
        ]
    return made
