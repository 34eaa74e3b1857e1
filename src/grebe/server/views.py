"""A survey in the forms that the page reads: its details, its state, its recorded mission."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.events import LogEntry
from grebe.core.quantities import Quantities
from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.io.store import SurveyFile
from grebe.io.store.tables import TrackTable
from grebe.report.thresholds import Profile, read_profile
from grebe.server.library import state_of, summary_of
from grebe.server.mission_delta import iso, number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Most points in the track of a snapshot, and the time that the samples of its charts span [s].
TRACK_POINTS = 4000
RECENT_S = 600.0
LOG_LINES = 500


def geojson(survey: Survey, geometry: BaseGeometry) -> dict[str, Any]:
    """A local geometry as GeoJSON in degrees, rounded to a centimetre."""
    return json.loads(shapely.to_geojson(_rounded(survey.frame.geometry_to_wgs84(geometry))))


def _rounded(geometry: BaseGeometry) -> BaseGeometry:
    return shapely.transform(geometry, lambda points: np.round(points, 7))


def rings(survey: Survey) -> list[list[list[float]]]:
    """The outline of each target in degrees."""
    made: list[list[list[float]]] = []
    for target in survey.targets:
        corners = (
            np.asarray(target.cell.exterior.coords)[:, :2]
            if target.cell is not None
            else np.asarray([*target.set.vertices, target.set.vertices[0]])
        )
        made.append(np.round(survey.frame.to_wgs84(corners), 7).tolist())
    return made


def bounds(survey: Survey) -> list[float]:
    """West, south, east, north of the water [deg]."""
    return [float(x) for x in survey.frame.geometry_to_wgs84(survey.water).bounds]


def quantity_table(quantities: Quantities, keys: Sequence[str]) -> list[dict[str, Any]]:
    """Quantities as the page shows them, each with its first threshold of concern."""
    profile: Profile = read_profile(None)
    first: dict[str, tuple[float, str]] = {}
    for each in profile.thresholds:
        first.setdefault(each.quantity, (each.value, each.sense))
    table: list[dict[str, Any]] = []
    for key in keys:
        quantity = quantities.known(key)
        table.append(
            {
                "id": key,
                "label": {"en": quantity.label, "fr": quantity.label_in("fr")},
                "unit": quantity.unit,
                "threshold": first.get(key, (None, ""))[0],
                "side": first.get(key, (None, "above"))[1],
            }
        )
    return table


def measured(file: SurveyFile) -> list[str]:
    """The quantities of a file that hold a value; before the first value, all that it declares."""
    samples = file.samples()
    keys = list(file.quantities)
    held = [key for key in keys if key in samples.values and np.isfinite(samples.values[key]).any()]
    return held or keys


def detail(survey_id: str, path: Path) -> dict[str, Any]:
    """The details of a survey, of which only states and counts change during a mission."""
    with SurveyFile.open(path) as file:
        survey, reached = file.survey, file.progress().reached_at
        meta = file.meta()
        return {
            "id": survey_id,
            **summary_of(file),
            "region": geojson(survey, survey.water),
            "targets": _target_table(survey, reached),
            "route": None,
            "settings": json.loads(meta.get("app_settings", "null")),
            "quantities": quantity_table(file.quantities, measured(file)),
            "link": meta.get("water"),
            "bounds": bounds(survey),
        }


def snapshot(survey_id: str, path: Path) -> dict[str, Any]:
    """The state of a survey from its file, with times in unix seconds: `begins` is the first,
    `last` that of the last row of the track, `sampled` that of the last sample. For a fleet, each
    of its `boats` has these entries of its own, and those of the survey are empty.
    """
    with SurveyFile.open(path) as file:
        survey, track, samples = file.survey, file.track(), file.samples()
        shown = [key for key in measured(file) if key in file.quantities]
        boats = range(1, survey.fleet.boats + 1) if survey.fleet else ()
        # Boat 0 does not exist, so a fleet's own track and samples are empty.
        whose = (track.of_boat(0), samples.of_boat(0)) if boats else (track, samples)
        return {
            "id": survey_id,
            **_of_boat(survey, *whose, shown),
            "begins": min((at.timestamp() for at in track.times), default=None),
            "order": list(file.quantities),
            "name": file.meta().get("app_name") or survey.name,
            "region": geojson(survey, survey.water),
            "bounds": bounds(survey),
            "targets": _target_table(survey, file.progress().reached_at),
            "route": None,
            "quantities": quantity_table(file.quantities, shown),
            "speed_window": _window(survey),
            "thrust_limit_n": [0.0, 0.0],
            "boats": [
                {
                    "boat": k,
                    "status": _of_part(file, k),
                    **_of_boat(survey, track.of_boat(k), samples.of_boat(k), shown),
                }
                for k in boats
            ],
            "events": [_event(one) for one in file.events()[-LOG_LINES:]],
            "status": _status(file, max(track.times, default=None)),
        }


def _of_part(file: SurveyFile, boat: int) -> dict[str, int]:
    """The progress of a boat of a fleet in its own sorties."""
    progress = file.progress()
    own = [sortie for sortie in file.revision.sorties if sortie.boat == boat]
    return {
        "reached": sum(progress.reached_in(sortie) for sortie in own),
        "targets": sum(len(sortie) for sortie in own),
    }


def _of_boat(
    survey: Survey, track: TrackTable, samples: Samples, shown: Sequence[str]
) -> dict[str, Any]:
    """A boat's track, its latest samples and its last state."""
    times = np.array([moment.timestamp() for moment in track.times])
    places = _places(survey, track.states[:, :2])
    last = float(times[-1]) if len(times) else 0.0
    return {
        "last": last,
        "sampled": float(np.max(samples.times, initial=0.0)),
        "track": _way(times, places, track.states[:, 3]),
        "samples": _recent(survey, samples, shown, last - RECENT_S),
        "estimate": _estimate(track.states[-1], places[-1]) if len(times) else None,
        "thrusts": track.thrusts[-1].tolist() if len(times) else None,
        "horizon": [],
        "current": _current(survey.settings),
        "wind": None,
    }


def _target_table(survey: Survey, reached_at: Sequence[object]) -> list[dict[str, Any]]:
    return [
        {"seq": target.seq, "ring": ring, "state": "reached" if at else "open"}
        for target, ring, at in zip(survey.targets, rings(survey), reached_at, strict=True)
    ]


def _way(times: Array, places: list[list[float]], surge: Array) -> list[list[Any]]:
    """At most `TRACK_POINTS` points of the track, evenly spread over its rows."""
    keep = np.linspace(0, len(times) - 1, min(len(times), TRACK_POINTS)).astype(int).tolist()
    return [[float(times[i]), *places[i], float(surge[i])] for i in keep]


def _recent(survey: Survey, samples: Samples, keys: Sequence[str], since: float) -> list[list[Any]]:
    """The samples after the time `since`: time, place and the values of some quantities."""
    recent = np.flatnonzero(samples.times > since)
    places = _places(survey, samples.positions[recent])
    values = [samples.values[key][recent] for key in keys if key in samples.values]
    if not values:
        return []
    return [
        [float(samples.times[i]), *places[k], [number(column[k]) for column in values]]
        for k, i in enumerate(recent.tolist())
    ]


def _event(event: LogEntry) -> dict[str, Any]:
    return {
        "at": event.time.timestamp(),
        "time": iso(event.time),
        "level": event.level,
        "code": event.code,
        "message": event.message,
    }


def _status(file: SurveyFile, seen: datetime | None) -> dict[str, Any]:
    """The status of a boat that is not connected."""
    reached, targets = file.progress().reached, len(file.survey.targets)
    nobody = dict.fromkeys(("link_age_s", "battery", "solve_ms", "fix", "eta_s"))
    return {
        "state": state_of(file),
        "doing": "",
        "time": iso(seen) if seen else None,
        "link": file.meta().get("water"),
        **nobody,
        "coverage": reached / max(1, targets),
        "reached": reached,
        "targets": targets,
        "samples": file.count("samples"),
        "rate": 1,
    }


def _window(survey: Survey) -> list[float]:
    cells = [one.set for one in survey.targets if one.kind == "cell"] or list(survey.sets)
    speeds = [(one.speed_min_mps, one.speed_max_mps) for one in cells]
    if not speeds:
        return [0.0, 0.0]
    return [min(low for low, _ in speeds), max(high for _, high in speeds)]


def _current(settings: Any) -> dict[str, float] | None:
    if settings is None:
        return None
    weather = settings.weather
    return {"north_mps": weather.current_north_mps, "east_mps": weather.current_east_mps}


def _estimate(state: NDArray[np.float64], place: list[float]) -> dict[str, float]:
    return {
        "lon": place[0],
        "lat": place[1],
        "heading_rad": float(state[2]),
        "surge_mps": float(state[3]),
        "sway_mps": float(state[4]),
        "yaw_rate_radps": float(state[5]),
    }


def _places(survey: Survey, local: NDArray[np.float64]) -> list[list[float]]:
    if not len(local):
        return []
    return np.round(survey.frame.to_wgs84(local), 7).tolist()


def replay(path: Path) -> dict[str, Any]:
    """A recorded mission as columns; times in seconds since the first row of its track."""
    with SurveyFile.open(path) as file:
        survey, track, samples = file.survey, file.track(), file.samples()
        times = np.array([moment.timestamp() for moment in track.times])
        zero = times[0] if len(times) else (samples.times[0] if len(samples.times) else 0.0)
        every = max(1, len(times) // 50_000)
        times, states = times[::every], track.states[::every]
        places = np.array(_places(survey, states[:, :2])).reshape(-1, 2)
        spots = np.array(_places(survey, samples.positions)).reshape(-1, 2)
        reached = sorted(
            (at.timestamp() - zero, target.seq)
            for target, at in zip(survey.targets, file.progress().reached_at, strict=True)
            if at is not None
        )
        return {
            "track": {
                "t": np.round(times - zero, 2).tolist(),
                "lon": places[:, 0].tolist(),
                "lat": places[:, 1].tolist(),
                "heading_rad": np.round(states[:, 2], 4).tolist(),
                "surge_mps": np.round(states[:, 3], 3).tolist(),
            },
            "samples": {
                "t": np.round(samples.times - zero, 2).tolist(),
                "lon": spots[:, 0].tolist(),
                "lat": spots[:, 1].tolist(),
                "values": {
                    key: [number(value) for value in column]
                    for key, column in samples.values.items()
                },
            },
            "reached": {"t": [at for at, _ in reached], "seq": [seq for _, seq in reached]},
            "events": [
                {
                    "t": event.time.timestamp() - zero,
                    "time": iso(event.time),
                    "level": event.level,
                    "code": event.code,
                    "message": event.message,
                }
                for event in file.events()
            ],
        }
