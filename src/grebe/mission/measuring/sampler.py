"""Takes samples during a mission: when a reading is due, where it belongs, and what is kept."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime

import numpy as np
import shapely

from grebe.core.events import State
from grebe.core.quantities import Quantities
from grebe.core.samples import Sample, gross_range_flag
from grebe.core.sets import TargetSet
from grebe.core.survey import Target
from grebe.links.base import BoatLink, Instruments, Observation, Reading
from grebe.mission.measuring.sampling import Sampling

# How long the boat's track is remembered for late readings, and how far beyond the last estimate a
# reading may be [s].
REMEMBERED_S, AHEAD_S = 30.0, 1.0


class Sampler:
    """Reads a boat's sonde when the mission wants a sample. Takes all readings of instruments with
    their own connections, at their own rate, wherever the boat was.
    """

    def __init__(
        self,
        targets: Sequence[Target],
        link: BoatLink,
        sampling: Sampling,
        quantities: Quantities,
        instruments: Instruments | None = None,
    ) -> None:
        self._link = link
        self._sampling, self._quantities = sampling, quantities
        self._instruments = instruments
        self._apart = frozenset(instruments.keys if instruments else ())
        self._next_s = 0.0
        self._mute_since_s: float | None = None
        self._way: deque[tuple[float, State]] = deque()
        self.look_for(targets)

    def look_for(self, targets: Sequence[Target]) -> None:
        """Assign samples to these targets from now on."""
        self._targets = targets
        self._tree = shapely.STRtree([target.set.polygon for target in targets])

    def take(
        self, observation: Observation, time: datetime, entered: Sequence[Target], ahead: TargetSet
    ) -> Sample | None:
        """Return the sample of an estimate that entered some targets and has the set `ahead` next;
        None if no sample is due or wanted, or there is no reading.
        """
        if not entered and observation.time_s < self._next_s - 1e-9:
            return None
        within = entered or self._containing(observation.state)
        if not self._sampling.keeps(observation.state[3], ahead, within):
            return None
        reading = dict(self._link.measure())
        self._next_s = observation.time_s + self._sampling.period_s
        if self._apart:
            reading = {key: value for key, value in reading.items() if key not in self._apart}
        if not reading:
            return None
        return self._sample(observation.state, time, within, reading)

    def instruments(
        self, observation: Observation, time_at: Callable[[float], datetime]
    ) -> list[Sample]:
        """Return the samples of instruments with their own connections since the last estimate,
        each placed where the boat was at the time; `time_at` converts the link's seconds to UTC.
        """
        if self._instruments is None:
            return []
        self._way.append((observation.time_s - observation.age_s, observation.state))
        # The newest entry stays, however late it arrived.
        while len(self._way) > 1 and self._way[0][0] < observation.time_s - REMEMBERED_S:
            self._way.popleft()
        found: list[Sample] = []
        for reading in self._instruments.readings():
            sample = self._placed(reading, observation.time_s - reading.age_s, time_at)
            if sample is not None:
                found.append(sample)
        return found

    def notes(self) -> Sequence[tuple[str, str]]:
        """Return what an operator should know of the instruments, as codes and sentences."""
        return () if self._instruments is None else self._instruments.notes()

    def mute(self, now_s: float) -> tuple[str, float]:
        """Return which instruments are silent, empty if none is, and for how long [s]."""
        names = () if self._instruments is None else self._instruments.silent
        if not names:
            self._mute_since_s = None
            return "", 0.0
        if self._mute_since_s is None:
            self._mute_since_s = now_s
        return " and ".join(names), now_s - self._mute_since_s

    def _placed(
        self, reading: Reading, at_s: float, time_at: Callable[[float], datetime]
    ) -> Sample | None:
        """Return a reading as a sample where the boat was; None if its place is not known."""
        state = self._state_at(at_s)
        if state is None:
            return None
        return self._sample(state, time_at(at_s), self._containing(state), reading.values)

    def _state_at(self, at_s: float) -> State | None:
        """Return the state interpolated between two estimates, or the last state up to `AHEAD_S`
        later; None outside.
        """
        last_s, last = self._way[-1]
        if at_s >= last_s:
            return last if at_s - last_s <= AHEAD_S else None
        if at_s < self._way[0][0]:
            return None
        times = [time_s for time_s, _ in self._way]
        after = int(np.searchsorted(times, at_s, side="right"))
        (from_s, before), (until_s, then) = self._way[after - 1], self._way[after]
        share = (at_s - from_s) / (until_s - from_s)
        north, east, heading, surge, sway, yaw_rate = (
            a + share * (b - a) for a, b in zip(before, then, strict=True)
        )
        return north, east, heading, surge, sway, yaw_rate

    def _sample(
        self, state: State, time: datetime, within: Sequence[Target], values: Mapping[str, float]
    ) -> Sample:
        north, east, _, surge, _, _ = state
        return Sample(
            time=time,
            north_m=north,
            east_m=east,
            target_seq=within[0].seq if within else None,
            speed_mps=surge,
            values=values,
            flags={
                key: gross_range_flag(values.get(key), one.span)
                for key, one in self._quantities.items()
            },
        )

    def _containing(self, state: State) -> list[Target]:
        point = shapely.Point(state[0], state[1])
        places = np.sort(self._tree.query(point)).tolist()
        return [t for t in (self._targets[i] for i in places) if t.set.contains(state)]
