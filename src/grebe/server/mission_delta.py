"""The events of a mission, gathered into the changes since the last message to its listeners."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.core.events import (
    Ended,
    EndReason,
    Estimate,
    MissionEvent,
    Prediction,
    Reached,
    Revised,
    SafetyChanged,
    SampleTaken,
    Started,
    Step,
    log_entry,
)
from grebe.core.survey import Survey
from grebe.links.base import BoatLink

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Spacing of the track's points on the page, in the boat's time [s].
TRACK_EACH_S = 1.0

STATES = {
    "surveying": "running",
    "freeing": "running",
    "holding": "paused",
    "returning": "returning",
}
ENDS = {
    EndReason.COMPLETE: "complete",
    EndReason.STOPPED: "stopped",
    EndReason.CAME_HOME: "stopped",
}


def number(value: float | None) -> float | None:
    """A finite number for JSON; None for anything else."""
    return None if value is None or not math.isfinite(value) else float(value)


class MissionDelta:
    """Listens to a mission; `take` returns the changes since the last `take`, or None.

    Times are unix seconds, positions degrees; `quantities` is the order of a sample's values.
    `heard` in the changes is when the oldest event among them arrived, by the clock of the
    mission's computer.
    """

    def __init__(self, survey: Survey, quantities: Sequence[str]) -> None:
        self.link: BoatLink | None = None
        self._survey = survey
        self._quantities = quantities
        self._lock = threading.Lock()
        self._changed: dict[str, Any] = {}
        self._status: dict[str, Any] = {"state": "running", "doing": "surveying"}
        self._current_seq: int | None = None
        self._track_after = -math.inf
        self._began: float | None = None
        self._reached_at_start = 0

    def take(self) -> dict[str, Any] | None:
        """Return the changes and start collecting new ones; None if there are none."""
        with self._lock:
            changed, self._changed = self._changed, {}
            if not changed:
                return None
            changed["status"] = {**self._status, **self._link_status()}
            return changed

    def on_event(self, event: MissionEvent) -> None:
        """Take in one event of the mission."""
        with self._lock:
            self._changed["time"] = event.time.timestamp()
            self._changed.setdefault("heard", time.time())
            self._note(event)
            entry = log_entry(event)
            if entry is not None:
                self._list("events").append(
                    {
                        "at": entry.time.timestamp(),
                        "time": iso(entry.time),
                        "level": entry.level,
                        "code": entry.code,
                        "message": entry.message,
                    }
                )

    def _note(self, event: MissionEvent) -> None:
        match event:
            case Started():
                self._began = event.time.timestamp()
                self._reached_at_start = event.reached
                self._status |= {"reached": event.reached, "targets": event.targets}
                # A boat that has done its part may set out again for another boat's targets.
                self._status |= {"state": "running", "doing": "surveying"}
            case Estimate():
                self._estimate(event)
            case Step():
                self._step(event)
            case Prediction():
                self._changed["horizon"] = self._places(event.states[:, :2])
            case SampleTaken(sample=sample):
                lon, lat = self._places([(sample.north_m, sample.east_m)])[0]
                values = [number(sample.values.get(key)) for key in self._quantities]
                self._list("samples").append([sample.time.timestamp(), lon, lat, values])
            case Reached():
                self._list("targets").append([event.target_seq, "reached"])
                self._reached(event)
            case Revised():
                self._status["targets"] = self._status.get("targets", 0) + event.more
                self._changed["revised"] = True
            case SafetyChanged():
                self._status |= {
                    "doing": event.after,
                    "state": STATES.get(event.after, self._status["state"]),
                }
            case Ended():
                self._status |= {
                    "state": ENDS.get(event.reason, "interrupted"),
                    "doing": event.reason.value,
                    "eta_s": None,
                }
            case _:
                pass

    def _estimate(self, event: Estimate) -> None:
        north, east, heading, surge, sway, yaw_rate = event.state
        lon, lat = self._places([(north, east)])[0]
        self._changed["estimate"] = {
            "lon": lon,
            "lat": lat,
            "heading_rad": math.remainder(heading, math.tau),
            "surge_mps": surge,
            "sway_mps": sway,
            "yaw_rate_radps": yaw_rate,
        }
        weather = event.weather
        self._changed["current"] = {
            "north_mps": weather.current_north_mps,
            "east_mps": weather.current_east_mps,
        }
        at = event.time.timestamp()
        if at >= self._track_after:
            self._track_after = at + TRACK_EACH_S
            self._list("track").append([at, lon, lat, surge])

    def _step(self, event: Step) -> None:
        self._changed["thrusts"] = list(event.thrusts)
        if event.solve_ms is not None:
            self._status["solve_ms"] = round(event.solve_ms, 1)
        seq = event.target_seq
        if seq is not None and seq != self._current_seq:
            if self._current_seq is not None:
                self._list("left").append(self._current_seq)
            self._current_seq = seq
            self._list("targets").append([seq, "current"])

    def _reached(self, event: Reached) -> None:
        self._status["reached"] = event.count
        done = event.count - self._reached_at_start
        left = self._status.get("targets", len(self._survey.targets)) - event.count
        if self._began is not None and done > 0:
            each_s = (event.time.timestamp() - self._began) / done
            self._status["eta_s"] = round(left * each_s, 1)

    def _link_status(self) -> dict[str, Any]:
        if self.link is None:
            return {}
        status = self.link.status()
        return {
            "link_age_s": round(status.age_s, 2),
            "fix": status.fix or None,
            "battery": {"volt": None, "fraction": number(status.battery_share)},
        }

    def _list(self, name: str) -> list[Any]:
        found: list[Any] = self._changed.setdefault(name, [])
        return found

    def _places(self, local: NDArray[np.float64] | Sequence[tuple[float, float]]) -> list[Any]:
        """Local places (n, 2) as [lon, lat] to a centimetre."""
        return np.round(self._survey.frame.to_wgs84(local), 7).tolist()


def iso(moment: datetime) -> str:
    """A time in ISO 8601, as the page reads it."""
    return moment.isoformat().replace("+00:00", "Z")
