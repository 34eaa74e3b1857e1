"""The fence of one mission: drawn where the boat begins, and redrawn when an area is closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import shapely

from grebe.core.survey import Survey
from grebe.mission.safety.fence import Fence, fence_of
from grebe.mission.safety.states import Place


@dataclass(kw_only=True)
class Enclosure:
    """The `fence` in force, None if there is none, and whether it applies to the boat yet: a boat
    launched from land is `fenced` once it is on the water.

    If an area is closed while the boat is in it, it is fenced off once the boat has left it.
    """

    fence: Fence | None = None
    fenced: bool = False
    _survey: Survey | None = None
    _within: list[shapely.Polygon] = field(default_factory=list[shapely.Polygon])

    def draw(self, survey: Survey, place: Place) -> None:
        """Draw the fence of a survey."""
        self._survey = survey
        self.fence = fence_of(survey.water, survey.no_go, place)

    def close(self, zones: Sequence[shapely.Polygon], place: Place) -> None:
        """Exclude zones from the fence."""
        self._within += zones
        self._leave(place)

    def contains(self, place: Place) -> bool:
        """Whether a boat's place is inside. Closed areas that the boat has left are fenced off."""
        if self._within:
            self._leave(place)
        inside = self.fence is None or self.fence.contains(place)
        self.fenced = self.fenced or inside
        return inside

    def _leave(self, place: Place) -> None:
        here = shapely.Point(place)
        left = [zone for zone in self._within if not zone.intersects(here)]
        if self._survey is None or not left:
            return
        self._within = [zone for zone in self._within if zone.intersects(here)]
        self.draw(replace(self._survey, no_go=(*self._survey.no_go, *left)), place)
