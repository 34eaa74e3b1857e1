"""A mission goes on where it pays, as soon as its order is sailed."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision
from grebe.io.store import SurveyFile
from grebe.planning.revisions.revise import Halfway
from grebe.workflow.adaptive import adapted
from grebe.workflow.announced import announced, lying
from grebe.workflow.quality import judged
from grebe.workflow.wish import Wish

# The time is spent in so many rounds, each planned by what the ones before have measured, but none
# shorter than this.
ROUNDS, SHORTEST_MINUTES = 4, 2.0


# Which boats of a fleet still sail, by their numbers.
Sailing = Callable[[], Collection[int]]


@dataclass(kw_only=True)
class Onward:
    """Makes the revisions by which a mission goes on, from what its file holds by then; of a fleet
    each boat has one of its own, which reads where the others are not going to. `sailing`: whose
    missions are not over; the others' places are kept clear of. None: nobody else is on the water.
    """

    path: Path
    wish: Wish
    sailing: Sailing | None = None
    _began_s: float | None = None

    def __call__(self, revision: PlanRevision, halfway: Halfway, time_s: float) -> PlanRevision:
        """Return the next round; `time_s` is the mission's. `PlanError` says why there is none:
        the time is over, or the map is sure enough.
        """
        wish, sailing = self.wish, () if self.sailing is None else self.sailing()
        minutes = self._next_minutes(time_s)
        with SurveyFile.open(self.path) as file:
            survey, quantities, samples = file.survey, file.quantities, file.samples()
            ways = announced(file, revision, halfway.sortie, sailing)
            closed = [] if self.sailing is None else lying(file, sailing)
        samples = replace(samples, flags=judged(samples, survey.water, quantities).flags)
        shorter = replace(wish, minutes=minutes)
        found = adapted(
            survey, revision, samples, quantities, halfway, shorter, announced=ways, closed=closed
        )
        if wish.sd is not None and found.before_sd <= wish.sd:
            raise PlanError(f"{wish.quantity} is known to {found.before_sd:.3g} everywhere")
        return found.revision

    def _next_minutes(self, time_s: float) -> float:
        """How long the next round is; `PlanError` where the time is over."""
        wish = self.wish
        if self._began_s is None:
            self._began_s = time_s
        left = wish.minutes - (time_s - self._began_s) / 60
        first = time_s == self._began_s
        if not first and left < min(SHORTEST_MINUTES, 0.5 * wish.minutes):
            raise PlanError(f"the {wish.minutes:g} minutes more for {wish.text} are over")
        return min(left, max(wish.minutes / ROUNDS, SHORTEST_MINUTES))
