"""The link's time, from times of day that wrap at midnight, and the delay of sentences.

A sentence with a time of day states when it was true; one without is taken to be true when it
comes. The fastest transfer from the receiver to us is taken to have no delay, and slower ones have
waited somewhere. The receiver's own latency, `late_s`, has to be known from its manual.
"""

from __future__ import annotations

import math

DAY_S = 86_400.0
# A receiver's time jumps when it sets its clock, whereas a gap in its sentences is a gap in our
# time too. A larger difference between the two times than this is a jump [s].
JUMP_S = 5.0
# The relative drift of two clocks; the fastest transfer is forgotten at this rate.
DRIFT = 2e-4


class StreamClock:
    """Converts times of day to seconds since the first one.

    `now_s` is always by the wire's clock, which never runs back.
    """

    def __init__(self, late_s: float = 0.0) -> None:
        self.jumps = 0
        self._late_s = late_s
        self._time_s = math.nan
        self._of_day = self._heard_s = 0.0
        # How far the wire's clock is ahead of the time of the fastest sentence [s].
        self._ahead_s = math.inf

    @property
    def begun(self) -> bool:
        """Whether any time of day has come."""
        return not math.isnan(self._time_s)

    def at(self, second_of_day: float, now_s: float) -> float | None:
        """Return the time [s] of a sentence that came now; None if a later one has overtaken it."""
        if not self.begun:
            return self._set(0.0, second_of_day, now_s)
        step_s = math.remainder(second_of_day - self._of_day, DAY_S)
        elapsed_s = now_s - self._heard_s
        if step_s == 0:
            return self._time_s
        if -JUMP_S < step_s < 0:
            return None
        if step_s < 0 or step_s > JUMP_S + elapsed_s:
            self.jumps += 1
            self._ahead_s = math.inf
            step_s = max(elapsed_s, 1e-3)
        return self._set(self._time_s + step_s, second_of_day, now_s)

    def now(self, now_s: float) -> float:
        """Return the link's time [s]; 0 before any time of day has come."""
        return now_s - self._ahead_s + self._late_s if self.begun else 0.0

    def _set(self, time_s: float, second_of_day: float, now_s: float) -> float:
        drifted_s = DRIFT * max(0.0, now_s - self._heard_s) if self.begun else 0.0
        self._time_s, self._of_day, self._heard_s = time_s, second_of_day, now_s
        self._ahead_s = min(self._ahead_s + drifted_s, now_s - time_s)
        return time_s
