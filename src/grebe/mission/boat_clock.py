"""The boat's own clock, by which a mission steers: the mission must not continue if it stops."""

from __future__ import annotations

from grebe.core.errors import LinkError
from grebe.core.events import EndReason
from grebe.links.base import Observation
from grebe.mission.gate import OverError

# The clock has stopped after this many repeats of one time in a row.
MOST_ALIKE = 20
# A step backwards by less than this is a rounding error [s].
ROUNDING_S = 1e-6
# A boat that has given no usable estimate after this time does not know where it is [s].
NEVER_SEEN_S = 60.0


class BoatClock:
    """Checks the times of the estimates."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._last_s: float | None = None
        self._alike = 0

    def update(self, observation: Observation, *, had_estimate: bool) -> None:
        """Check the time of an estimate, usable or not; `had_estimate` says whether any was usable.

        Raises `LinkError` if the clock stands still or runs back, because nothing that is planned
        would then ever be due, and `OverError` for a boat that never reports where it is.
        """
        now, last = observation.time_s, self._last_s
        if last is not None and now < last - ROUNDING_S:
            raise LinkError(f"The boat's clock went backwards, from {last:g} s to {now:g} s.")
        self._alike = self._alike + 1 if now == last else 0
        self._last_s = now
        if self._alike >= MOST_ALIKE:
            raise LinkError(
                f"The boat's clock has stopped: {self._alike + 1} estimates in a row have the "
                f"time {now:g} s."
            )
        self._first_s = now if self._first_s is None else self._first_s
        if not had_estimate and now - self._first_s > NEVER_SEEN_S:
            raise OverError(
                EndReason.BLIND,
                f"no estimate of the boat's position came within {NEVER_SEEN_S:g} s",
            )
