"""The fence of one mission: drawn where the boat begins, and drawn in where an area is closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import shapely

from grebe.core.survey import Survey
from grebe.mission.safety.fence import Fence, fence_of
from grebe.mission.safety.states import Place


@dataclass(kw_only=True)
class Enclosure:
    """The `fence` in force, None where there is none, and whether the boat has been inside: one
    that is launched from land is `fenced` in once it is on the water.

    An area in which the boat is when it is closed is fenced off once the boat has left it.
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
        """Draw the fence in by zones."""
        self._within += zones
        self._leave(place)

    def holds(self, place: Place) -> bool:
        """Whether a boat's place is inside; what it has left by now is fenced off."""
        if self._within:
            self._leave(place)
        inside = self.fence is None or self.fence.holds(place)
        self.fenced = self.fenced or inside
        return inside

    def _leave(self, place: Place) -> None:
        here = shapely.Point(place)
        left = [zone for zone in self._within if not zone.intersects(here)]
        if self._survey is None or not left:
            return
        self._within = [zone for zone in self._within if zone.intersects(here)]
        self.draw(replace(self._survey, no_go=(*self._survey.no_go, *left)), place)
