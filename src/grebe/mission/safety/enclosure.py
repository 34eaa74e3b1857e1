"""The fence of one mission: drawn where the boat begins, and drawn in where an area is closed."""

from __future__ import annotations

from dataclasses import dataclass

from grebe.core.survey import Survey
from grebe.mission.safety.fence import Fence, fence_of
from grebe.mission.safety.states import Place


@dataclass(kw_only=True)
class Enclosure:
    """The `fence` in force, None where there is none, and whether the boat has been inside: one
    that is launched from land is `fenced` in once it is on the water.

    A boat that is in an area when that is closed is fenced in as before until it has left it.
    """

    fence: Fence | None = None
    fenced: bool = False
    _next: Fence | None = None

    def draw(self, survey: Survey, place: Place) -> None:
        """Draw the fence of a survey, or draw it in."""
        new = fence_of(survey.water, survey.no_go, place)
        if self.fence is None or not self.fenced or new.holds(place):
            self.fence, self._next = new, None
        else:
            self._next = new

    def holds(self, place: Place) -> bool:
        """Whether a boat's place is inside; what is next is in force once the boat is in it."""
        if self._next is not None and self._next.holds(place):
            self.fence, self._next = self._next, None
        inside = self.fence is None or self.fence.holds(place)
        self.fenced = self.fenced or inside
        return inside
