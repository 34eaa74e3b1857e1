"""Extend a mission where readings pay, as soon as its order is sailed."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision
from grebe.io.store import SurveyFile
from grebe.planning.revisions.revise import Halfway
from grebe.workflow.adaptive import adapted
from grebe.workflow.announced import announced, moored_areas
from grebe.workflow.quality import judged
from grebe.workflow.wish import Wish

# The time is divided into this many rounds, or fewer that are about this long; each is planned with
# the measurements of those before. What is left of the time is sailed if it is half a round.
ROUNDS, SHORTEST_MINUTES = 4, 2.0


# The boats of a fleet that still sail, by their numbers.
Sailing = Callable[[], Collection[int]]


@dataclass(kw_only=True)
class Onward:
    """Makes the revisions by which a mission goes on, from what its file holds by then.

    Each boat of a fleet has one of its own, which reads where the others are not going to.
    `sailing` returns the boats whose missions are not over; the places of the others are kept clear
    of. None: nobody else is on the water.
    """

    path: Path
    wish: Wish
    sailing: Sailing | None = None
    _began_s: float | None = None

    def __call__(self, revision: PlanRevision, halfway: Halfway, time_s: float) -> PlanRevision:
        """Return the next round; `time_s` is the mission's.

        `PlanError` says why there is none: the time is over, or the map is accurate enough.
        """
        wish, sailing = self.wish, () if self.sailing is None else self.sailing()
        minutes = self._next_minutes(time_s)
        with SurveyFile.open(self.path) as file:
            survey, quantities, samples = file.survey, file.quantities, file.samples()
            paths = announced(file, revision, halfway.sortie, sailing)
            closed = [] if self.sailing is None else moored_areas(file, sailing)
        samples = replace(samples, flags=judged(samples, survey.water, quantities).flags)
        shorter = replace(wish, minutes=minutes)
        found = adapted(
            survey, revision, samples, quantities, halfway, shorter, announced=paths, closed=closed
        )
        if wish.sd is not None and found.before_sd <= wish.sd:
            raise PlanError(f"{wish.quantity} is known to {found.before_sd:.3g} everywhere")
        return found.revision

    def _next_minutes(self, time_s: float) -> float:
        """Return how long the next round is [min]; `PlanError` if the time is over."""
        wish = self.wish
        if self._began_s is None:
            self._began_s = time_s
        left = wish.minutes - (time_s - self._began_s) / 60
        first = time_s == self._began_s
        shortest = max(wish.minutes / ROUNDS, min(SHORTEST_MINUTES, wish.minutes))
        if not first and left < 0.5 * shortest:
            raise PlanError(f"the {wish.minutes:g} extra minutes for {wish.text} are over")
        return left / max(math.floor(left / shortest), 1)
