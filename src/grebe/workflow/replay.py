"""A recorded survey as a boat, by its URL: `replay:FILE`, `replay:FILE?speed=10`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import LinkError
from grebe.core.quantities import Quantities
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile, TrackTable
from grebe.links.replay import LONGEST_GAP_S, Recording, ReplayLink, drawn_between
from grebe.mission.departure import Departure
from grebe.simulation.plant import Plant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.workflow.run import BoatAt

FASTEST = "max"


def replay_boat(rest: str) -> BoatAt:
    """Return the function that opens the boat of `replay:FILE?speed=N`.

    The speed is a multiple of the recorded one, 1 by default; `max` is as fast as the mission
    computes.
    """
    name, speed = _parts(rest)
    path = Path(name)
    if not path.is_file():
        raise LinkError(f"replay:{name}: there is no such file.")

    def boat_at(departure: Departure) -> ReplayLink:
        recording = recording_of(path, departure.survey, departure.quantities)
        return ReplayLink(recording, speed)

    return boat_at


def recording_of(path: Path, survey: Survey, quantities: Quantities) -> Recording:
    """Read the track of a survey file and its samples of some quantities.

    They are in the frame of `survey`, to which they are played. Raises `LinkError` for a file
    without a track, `SurveyFileError` for one that is not a survey file.
    """
    with SurveyFile.open(path) as file:
        track, samples, recorded = file.track(), file.samples(), file.survey
        arrivals = [moment for moment in file.progress().reached_at if moment is not None]
    if not len(track):
        raise LinkError(f"{path} holds no track to replay; run it first.")
    last_s = (max([*arrivals, track.times[-1]]) - track.times[0]).total_seconds()
    rising = _rising(track.seconds)
    seconds, states = _prolonged(track, rising, recorded.vessel, last_s)
    states[:, :2] = survey.frame.to_local(recorded.frame.to_wgs84(states[:, :2]))
    began_s = track.times[0].timestamp()
    known = {key: column for key, column in samples.values.items() if key in quantities}
    readings = [
        (
            float(samples.times[i]) - began_s,
            {key: float(column[i]) for key, column in known.items() if math.isfinite(column[i])},
        )
        for i in np.argsort(samples.times, kind="stable").tolist()
    ]
    return drawn_between(
        Recording(name=path.name, seconds=seconds, states=states, readings=readings)
    )


def _prolonged(
    track: TrackTable, rows: NDArray[np.bool_], vessel: Vessel | None, last_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times and states of some rows, and where the boat went after the last one.

    It went on under its last command. The last target was reached after that row: a track holds
    commands, not estimates.
    """
    seconds, states = track.seconds[rows], track.states[rows]
    left_s = min(last_s - seconds[-1], LONGEST_GAP_S)
    if vessel is None or left_s <= 0:
        return seconds, states
    plant = Plant(vessel, tuple(states[-1].tolist()))
    plant.command(tuple(track.thrusts[-1].tolist()))
    plant.advance(left_s)
    return np.append(seconds, seconds[-1] + left_s), np.vstack([states, plant.state])


def _rising(seconds: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the rows that are later than all before.

    A time may have two rows if the thrusts changed.
    """
    before = np.concatenate([[-np.inf], np.maximum.accumulate(seconds)[:-1]])
    return seconds > before


def _parts(rest: str) -> tuple[str, float]:
    """Return the file's name and the factor by which it is played faster."""
    name, _, query = rest.partition("?")
    if not query:
        return name, 1.0
    key, _, value = query.partition("=")
    if key == "speed" and value == FASTEST:
        return name, math.inf
    try:
        speed = float(value) if key == "speed" else math.nan
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0):
        raise LinkError(f"replay: takes ?speed=N, with N > 0 or {FASTEST}, not ?{query}.")
    return name, speed
