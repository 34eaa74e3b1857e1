"""Export a plan for other programs: ground stations, GPS receivers, maps.

The formats are QGroundControl's `.plan` (JSON: mission, geofence, rally point), Mission Planner's
`.waypoints` (QGC WPL 110), GPX, KML and GeoJSON. Waypoints are the targets' centres in order, in
WGS 84; altitudes are zero.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np
import shapely

from grebe.core.errors import UsageError
from grebe.core.survey import Survey
from grebe.io.atomic_write import write_text_whole
from grebe.io.export.samples import WRITERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

# MAVLink: MAV_CMD_NAV_WAYPOINT, MAV_CMD_DO_CHANGE_SPEED, MAV_FRAME_GLOBAL_RELATIVE_ALT.
NAV_WAYPOINT, CHANGE_SPEED, RELATIVE_ALT = 16, 178, 3
# MAV_AUTOPILOT_ARDUPILOTMEGA, MAV_TYPE_SURFACE_BOAT.
ARDUPILOT, SURFACE_BOAT = 3, 11


def export_text(survey: Survey, suffix: str) -> str:
    """Return the plan in the format that a file's suffix names; `UsageError` for others."""
    writers: dict[str, Callable[[Survey], str]] = {
        ".plan": _qgroundcontrol,
        ".waypoints": _mission_planner,
        ".gpx": _gpx,
        ".kml": _kml,
        ".geojson": _geojson,
    }
    if suffix not in writers:
        raise UsageError(
            f"Cannot export as {suffix!r}; give {', '.join(writers)} for the plan, or "
            f"{', '.join(WRITERS)} for the samples."
        )
    return writers[suffix](survey)


def write_export(survey: Survey, path: Path) -> None:
    """Write the plan to a file in the format that its suffix names."""
    write_text_whole(path, export_text(survey, path.suffix.lower()))


def _lonlat(survey: Survey) -> NDArray[np.float64]:
    return survey.frame.to_wgs84(np.array([target.set.centre for target in survey.targets]))


def _home(survey: Survey) -> tuple[float, float]:
    """Return longitude and latitude of the start, or of the first target."""
    if survey.start is None:
        lon, lat = _lonlat(survey)[0].tolist()
    else:
        place = np.array([survey.start.north_m, survey.start.east_m])
        lon, lat = survey.frame.to_wgs84(place).tolist()
    return lon, lat


def _pace(survey: Survey) -> float:
    """Return the middle of the cells' speed window [m/s]."""
    target = next(t for t in survey.targets if t.kind == "cell")
    return 0.5 * (target.set.speed_min_mps + target.set.speed_max_mps)


def _qgroundcontrol(survey: Survey) -> str:
    lon, lat = _home(survey)
    pace = _pace(survey)
    speed_item = _item(1, CHANGE_SPEED, 2, [1, pace, -1, 0, 0, 0, 0])
    waypoints = [
        _item(i, NAV_WAYPOINT, RELATIVE_ALT, [0, 0, 0, None, y, x, 0])
        for i, (x, y) in enumerate(_lonlat(survey).tolist(), start=2)
    ]
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"version": 2, "circles": [], "polygons": _fences(survey)},
        "rallyPoints": {"version": 2, "points": [[lat, lon, 0]]},
        "mission": {
            "version": 2,
            "firmwareType": ARDUPILOT,
            "vehicleType": SURFACE_BOAT,
            "cruiseSpeed": pace,
            "hoverSpeed": pace,
            "plannedHomePosition": [lat, lon, 0],
            "items": [speed_item, *waypoints],
        },
    }
    return json.dumps(document, indent=1)


def _item(number: int, command: int, frame: int, params: list[Any]) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "doJumpId": number,
        "frame": frame,
        "params": params,
    }


def _fences(survey: Survey) -> list[dict[str, Any]]:
    """Return the shore to stay within, and the islands and no-go zones to stay out of."""
    water = survey.frame.geometry_to_wgs84(survey.water)
    zones = [survey.frame.geometry_to_wgs84(zone) for zone in survey.no_go]
    rings = [(True, shapely.get_exterior_ring(water))]
    rings += [(False, ring) for ring in shapely.get_rings(water)[1:]]
    rings += [(False, shapely.get_exterior_ring(zone)) for zone in zones]
    return [
        {
            "inclusion": inclusion,
            "version": 1,
            "polygon": [[y, x] for x, y in shapely.get_coordinates(ring)[:-1].tolist()],
        }
        for inclusion, ring in rings
    ]


def _mission_planner(survey: Survey) -> str:
    lon, lat = _home(survey)
    lines = ["QGC WPL 110", _line(0, 1, 0, NAV_WAYPOINT, (0, 0, 0, 0), lat, lon)]
    lines.append(_line(1, 0, RELATIVE_ALT, CHANGE_SPEED, (1, _pace(survey), 0, 0), 0.0, 0.0))
    lines += [
        _line(i, 0, RELATIVE_ALT, NAV_WAYPOINT, (0, 0, 0, 0), y, x)
        for i, (x, y) in enumerate(_lonlat(survey).tolist(), start=2)
    ]
    return "\n".join(lines) + "\n"


def _line(
    number: int,
    current: int,
    frame: int,
    command: int,
    params: tuple[float, float, float, float],
    lat: float,
    lon: float,
) -> str:
    values = [*(f"{p:.8f}" for p in params), f"{lat:.8f}", f"{lon:.8f}", "0.000000"]
    return "\t".join([str(number), str(current), str(frame), str(command), *values, "1"])


def _gpx(survey: Survey) -> str:
    points = "".join(
        f'<rtept lat="{y:.8f}" lon="{x:.8f}"><name>{t.seq}</name><type>{t.kind}</type></rtept>\n'
        for (x, y), t in zip(_lonlat(survey).tolist(), survey.targets, strict=True)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<gpx version="1.1" creator="Grebe" xmlns="http://www.topografix.com/GPX/1/1">\n'
        f"<rte><name>{escape(survey.name)}</name>\n{points}</rte>\n</gpx>\n"
    )


def _kml(survey: Survey) -> str:
    route = " ".join(f"{x:.8f},{y:.8f}" for x, y in _lonlat(survey).tolist())
    cells = "".join(
        f"<Placemark><name>{t.seq}</name><description>{t.kind}</description>"
        f"<Polygon><outerBoundaryIs><LinearRing><coordinates>{_ring(survey, t.set.polygon)}"
        "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>\n"
        for t in survey.targets
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{escape(survey.name)}</name>\n"
        f"<Placemark><name>route</name><LineString><coordinates>{route}</coordinates>"
        f"</LineString></Placemark>\n<Folder><name>targets</name>\n{cells}</Folder>\n"
        "</Document></kml>\n"
    )


def _ring(survey: Survey, polygon: shapely.Polygon) -> str:
    degrees = survey.frame.geometry_to_wgs84(polygon)
    return " ".join(f"{x:.8f},{y:.8f}" for x, y in shapely.get_coordinates(degrees).tolist())


def _geojson(survey: Survey) -> str:
    features: list[dict[str, Any]] = [
        {
            "type": "Feature",
            "properties": {
                "seq": t.seq,
                "kind": t.kind,
                "speed_min_mps": t.set.speed_min_mps,
                "speed_max_mps": t.set.speed_max_mps,
            },
            "geometry": json.loads(
                shapely.to_geojson(survey.frame.geometry_to_wgs84(t.set.polygon))
            ),
        }
        for t in survey.targets
    ]
    route = {"type": "LineString", "coordinates": _lonlat(survey).tolist()}
    features.append({"type": "Feature", "properties": {"kind": "route"}, "geometry": route})
    return json.dumps({"type": "FeatureCollection", "name": survey.name, "features": features})
