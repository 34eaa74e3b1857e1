"""Close areas while a boat sails, by a file of polygons that is read again when it changes.

Whoever finds swimmers, a net or a regatta on the lake writes their outline into the file. An area
stays closed until the mission is over. The file is looked at once a second of the boat's time,
outside the loop's own work, and is read only when it has changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import shapely

from grebe.core.errors import InputError
from grebe.core.events import Estimate, MissionEvent
from grebe.core.survey import Survey
from grebe.mission.loop import Mission
from grebe.planning.region import Region
from grebe.workflow.plans import read_zones

LOOKED_AT_S = 1.0

# What a version of the file is recognised by: when it was written [ns], and its size [bytes].
Mark = tuple[int, int]


@dataclass(kw_only=True)
class Closures:
    """The areas that a file closes to one mission; `say` is called with messages about the file.

    The constructor raises what `read_zones` raises if the file exists and is wrong. A file that
    does not exist yet closes nothing.
    """

    path: Path
    survey: Survey
    say: Callable[[str], None]
    _mission: Mission | None = None
    _closed: list[shapely.Polygon] = field(default_factory=list[shapely.Polygon])
    _seen: Mark | None = None
    _said: str = ""
    _next_s: float = -math.inf

    def __post_init__(self) -> None:
        if self.path.exists():
            self._read()

    def begin(self, mission: Mission) -> None:
        """Close the areas to a mission that the file holds now or later."""
        self._mission, self._seen, self._closed, self._next_s = mission, None, [], -math.inf

    def __call__(self, event: MissionEvent) -> None:
        """Look at the file, once a second."""
        if not isinstance(event, Estimate) or event.elapsed_s < self._next_s:
            return
        self._next_s = event.elapsed_s + LOOKED_AT_S
        try:
            mark = self._mark()
            if mark is not None and mark != self._seen:
                self._close(self._read())
                self._seen = mark
        # A file that is being written will be complete at the next look. Whatever is wrong with it,
        # the next version must be looked at.
        except Exception as error:
            if str(error) != self._said:
                self._said = str(error)
                self.say(f"the closed areas in {self.path} cannot be read: {error}")

    def _mark(self) -> Mark | None:
        if not self.path.exists():
            return None
        about = self.path.stat()
        return about.st_mtime_ns, about.st_size

    def _read(self) -> list[shapely.Polygon]:
        region = Region(name=self.survey.name, frame=self.survey.frame, water=self.survey.water)
        try:
            zones, notes = read_zones([self.path], region, mends=True)
        except InputError as error:
            if "crs" not in error.settings:
                raise
            # A run has no setting for it, and the file may change while it sails.
            raise InputError(
                f"{self.path}: must be in degrees (WGS 84), or name its coordinates itself, by a "
                ".prj file or as GeoJSON's crs."
            ) from None
        for note in notes:
            self.say(note)
        return [zone for zone in zones if zone.intersects(region.water)]

    def _close(self, zones: list[shapely.Polygon]) -> None:
        new = [zone for zone in zones if not any(zone.equals(old) for old in self._closed)]
        if not new or self._mission is None:
            return
        self._closed += new
        area = shapely.union_all(new).area
        self._mission.close(new, f"{self.path.name}: an area of {area:,.0f} m2 is closed")
