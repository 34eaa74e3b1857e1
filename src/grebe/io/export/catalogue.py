"""The catalogue entry of a set of maps: place, time, quantities, authors, and terms of use.

One record provides the global attributes of `map.nc`, by ACDD 1.3 (Attribute Convention for Data
Discovery), and the STAC item beside the GeoTIFFs. Unknown attributes are omitted, never made up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

import shapely

from grebe.core.errors import InputError
from grebe.core.quantity import inline

ACDD = "ACDD-1.3"
VOCABULARY = "CF Standard Name Table v93"


@dataclass(frozen=True, kw_only=True)
class CatalogueEntry:
    """A set of maps as a catalogue lists it.

    `outline` is the water in (longitude, latitude) [deg]; `first_s` and `last_s` [unix s] are the
    times of the first and the last sample, and `every_s` is the usual interval [s]; `created_s`
    [unix s] is when the maps were made; `resolution_m` is that of their nodes; `credits` are by
    ACDD's names; `simulated`: nothing was measured.
    """

    title: str
    identifier: str
    outline: shapely.Polygon
    quantities: Sequence[str]
    resolution_m: float
    created_s: float
    first_s: float
    last_s: float
    every_s: float
    source: str = ""
    history: str = ""
    comment: str = ""
    credits: Mapping[str, str] = field(default_factory=dict[str, str])
    simulated: bool = False

    def __post_init__(self) -> None:
        west, south, east, north = self.outline.bounds
        if not (-180 <= west <= east <= 180 and -90 <= south <= north <= 90):
            raise InputError(
                f"{self.title}: the outline's bounds are not longitudes and latitudes."
            )
        if not self.first_s <= self.last_s:
            raise InputError(f"{self.title}: the last sample is older than the first.")

    @property
    def summary(self) -> str:
        """A summary in one sentence."""
        when = f"{datetime.fromtimestamp(self.first_s, UTC):%Y-%m-%d}"
        boat = "a simulated boat (of simulated water)" if self.simulated else "a boat"
        return self.credits.get("summary") or (
            f"Maps of {', '.join(map(inline, self.quantities))} in the surface water, each with "
            f"its standard deviation, interpolated from samples that {boat} took on {when}."
        )

    @property
    def keywords(self) -> tuple[str, ...]:
        """The words to find it by."""
        given = [one.strip() for one in self.credits.get("keywords", "").split(",")]
        usual = ("limnology", "lake", "water quality", *(one.lower() for one in self.quantities))
        return tuple(dict.fromkeys(one for one in (*given, *usual) if one))


def time_text(seconds: float) -> str:
    """Return a time [unix s] in ISO 8601, in UTC."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _digits(seconds: float) -> str:
    """Return seconds as an ISO 8601 duration has them: without an exponent."""
    return f"{seconds:.0f}" if seconds >= 100 else f"{seconds:.3g}"


def acdd(
    entry: CatalogueEntry, bounds: tuple[float, float, float, float]
) -> dict[str, str | float]:
    """Return the global attributes of a NetCDF file, by ACDD 1.3.

    `bounds` are those of its nodes: west, south, east, north [deg].
    """
    west, south, east, north = bounds
    # ACDD has the corners of a box in EPSG:4326, and so latitude first.
    box = shapely.box(south, west, north, east)
    found: dict[str, str | float] = {
        "title": entry.title,
        "summary": entry.summary,
        "keywords": ", ".join(entry.keywords),
        "id": entry.identifier,
        "source": entry.source,
        "history": entry.history,
        "comment": entry.comment,
        "processing_level": "interpolated from quality-controlled samples",
        "standard_name_vocabulary": VOCABULARY,
        "cdm_data_type": "Grid",
        "date_created": time_text(entry.created_s),
        "geospatial_bounds": box.wkt,
        "geospatial_bounds_crs": "EPSG:4326",
        "geospatial_lat_min": south,
        "geospatial_lat_max": north,
        "geospatial_lat_units": "degrees_north",
        "geospatial_lon_min": west,
        "geospatial_lon_max": east,
        "geospatial_lon_units": "degrees_east",
        "geospatial_lat_resolution": f"{entry.resolution_m:g} m",
        "geospatial_lon_resolution": f"{entry.resolution_m:g} m",
        "time_coverage_start": time_text(entry.first_s),
        "time_coverage_end": time_text(entry.last_s),
        "time_coverage_duration": f"PT{entry.last_s - entry.first_s:.0f}S",
        "time_coverage_resolution": f"PT{_digits(entry.every_s)}S",
    }
    found |= {name: value for name, value in entry.credits.items() if name != "keywords"}
    return {name: value for name, value in found.items() if value != ""}
