"""A recorded survey as a boat: it repeats its track, at any speed, whatever its orders.

This is for displays, for rehearsals with one's own data, and for comparing controllers: the mission
records what its controller would have done, beside where the boat was.
"""

from __future__ import annotations

import bisect
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import LinkError, UsageError
from grebe.links.base import BoatStatus, Observation, Order

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A survey file has the boat's state at each command. Estimates in between are interpolated at this
# period; across a longer gap the boat was not observed [s].
PERIOD_S = 0.1
LONGEST_GAP_S = 3.0
# A reading applies to the boat's place for this long [s].
READING_S = 1.5
OVER = "the recording ends here"


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A recorded track and its readings.

    `seconds` (n,) count from the first estimate and increase. `states` (n, 6) are in the frame of
    the survey for which it is replayed. `readings` each have their time [s], in order. Raises
    `LinkError` if there is nothing to replay, or time does not increase.
    """

    name: str
    seconds: NDArray[np.float64]
    states: NDArray[np.float64]
    readings: Sequence[tuple[float, Mapping[str, float]]] = ()

    def __post_init__(self) -> None:
        if len(self.seconds) == 0 or self.states.shape != (len(self.seconds), 6):
            raise LinkError(f"{self.name} holds no track to replay.")
        if not np.all(np.diff(self.seconds) > 0):
            raise LinkError(
                f"{self.name} cannot be replayed: the times of its track do not increase."
            )


def drawn_between(recording: Recording) -> Recording:
    """Return a recording interpolated to an estimate at least every `PERIOD_S`.

    Between two estimates, place and heading are the cubics with the same values and rates at both
    ends, and velocities are linear. Gaps of more than `LONGEST_GAP_S` stay gaps.
    """
    seconds, states = recording.seconds, recording.states.copy()
    states[:, 2] = np.unwrap(states[:, 2])
    gaps = np.diff(seconds)
    parts = np.where(gaps <= LONGEST_GAP_S, np.ceil(gaps / PERIOD_S - 1e-6), 1).astype(int)
    left = np.repeat(np.arange(len(gaps)), parts)
    step = np.arange(len(left)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (step / parts[left])[:, None]
    width = gaps[left][:, None]
    rates = _rates(states)
    start, end = states[left, :3], states[left + 1, :3]
    drawn = np.empty((len(left) + 1, 6))
    drawn[:-1, :3] = (
        (1 + 2 * share) * (1 - share) ** 2 * start
        + share**2 * (3 - 2 * share) * end
        + width * share * (1 - share) ** 2 * rates[left]
        - width * share**2 * (1 - share) * rates[left + 1]
    )
    drawn[:-1, 3:] = (1 - share) * states[left, 3:] + share * states[left + 1, 3:]
    drawn[-1] = states[-1]
    times = np.append(seconds[left] + (share * width)[:, 0], seconds[-1])
    return replace(recording, seconds=times, states=drawn)


def _rates(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the velocities north and east, and the yaw rates (n, 3) [m/s, m/s, rad/s]."""
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    surge, sway, turn = states[:, 3], states[:, 4], states[:, 5]
    return np.column_stack([cos * surge - sin * sway, sin * surge + cos * sway, turn])


class ReplayLink:
    """Returns a recording's estimates in order, `speed` times as fast as they were recorded, by
    default as fast as they are requested.

    `clock` and `sleep` use wall-clock time.
    """

    def __init__(
        self,
        recording: Recording,
        speed: float = math.inf,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not speed > 0:
            raise UsageError(
                f"A recording cannot be replayed {speed:g} times as fast; give more than 0."
            )
        self.source = f"replay of {recording.name}"
        self._recording = recording
        self._speed = speed
        self._clock, self._sleep = clock, sleep
        self._reading_times = [second for second, _ in recording.readings]
        self._next = self._read = 0
        self._began_s = math.nan
        self._closed = False

    def observe(self) -> Observation:
        """Return the next estimate when its time has come; `LinkError` after the last one."""
        if self._closed:
            raise LinkError("The replayed boat has been closed.")
        if self._next == len(self._recording.seconds):
            raise LinkError(f"{self.source}: {OVER}.")
        time_s = float(self._recording.seconds[self._next])
        self._wait(time_s)
        north, east, heading, surge, sway, yaw_rate = self._recording.states[self._next].tolist()
        self._next += 1
        return Observation(time_s=time_s, state=(north, east, heading, surge, sway, yaw_rate))

    def _wait(self, time_s: float) -> None:
        if math.isinf(self._speed):
            return
        if math.isnan(self._began_s):
            self._began_s = self._clock() - time_s / self._speed
        # Sleep in short pieces, so that a signal is handled soon.
        while (left_s := self._began_s + time_s / self._speed - self._clock()) > 0:
            self._sleep(min(left_s, 0.2))

    def command(self, order: Order) -> None:
        """Do nothing: the boat continues as recorded, and only the mission records the order."""

    def measure(self) -> Mapping[str, float]:
        """Return the newest reading recorded by now; each is returned once."""
        if self._next == 0:
            return {}
        now_s = float(self._recording.seconds[self._next - 1])
        newest = bisect.bisect_right(self._reading_times, now_s) - 1
        if newest < self._read or now_s - self._reading_times[newest] > READING_S:
            return {}
        self._read = newest + 1
        return self._recording.readings[newest][1]

    def status(self) -> BoatStatus:
        """Return a status that requests the end of the mission once the recording has ended."""
        over = self._next == len(self._recording.seconds)
        return BoatStatus(
            mode="replay",
            armed=not self._closed,
            fix="recorded",
            stop_request=OVER if over else "",
        )

    def stop(self) -> None:
        """Do nothing: a recording moves no boat."""

    def close(self) -> None:
        """Close the link."""
        self._closed = True
