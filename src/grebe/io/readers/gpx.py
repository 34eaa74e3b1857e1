"""A GPX track as a table: a row for each point, a column for each element that points have."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from grebe.core.errors import TrackError
from grebe.io.readers.table import Table
from grebe.io.readers.untrusted import check_xml

# Elements of Garmin's TrackPointExtension, with the column names that loggers use. Its depth is
# that of the water below a boat, or of a diver.
_KNOWN = {"wtemp": "water temperature (degC)", "depth": "water depth (m)"}


def read_gpx(path: Path) -> Table:
    """Read the points of all tracks of a GPX file, in their order; `TrackError` says what is wrong.

    The columns are time, latitude, longitude and the elements of the points that hold a text,
    including those of extensions.
    """
    check_xml(path)
    points = [one for one in ET.parse(path).getroot().iter() if _name(one.tag) == "trkpt"]
    if not points:
        raise TrackError(
            f"{path}: holds no track (<trk>): routes and waypoints do not say when the boat was "
            "there."
        )
    rows = [_row(point) for point in points]
    header = list(
        dict.fromkeys(("time", "latitude", "longitude", *(key for row in rows for key in row)))
    )
    return Table(header=header, rows=[[row.get(name, "") for name in header] for row in rows])


def _row(point: ET.Element) -> dict[str, str]:
    cells = {"latitude": point.get("lat", ""), "longitude": point.get("lon", "")}
    for one in point.iter():
        text = (one.text or "").strip()
        if text and one is not point:
            name = _name(one.tag)
            cells.setdefault(_KNOWN.get(name, name), text)
    return cells


def _name(tag: str) -> str:
    """Return an element's name without its namespace."""
    return tag.rpartition("}")[2]
