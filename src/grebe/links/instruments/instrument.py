"""An instrument in its own thread, so that it never delays the mission, whatever its faults.

Readings wait in a bounded queue until the mission takes them. If a line breaks or an instrument
falls silent, it is opened again at increasing intervals; each of these faults is reported once.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from grebe.core.quantities import Quantities
from grebe.links.base import Reading
from grebe.links.instruments.decoding import DecodedReading
from grebe.links.instruments.profile import Profile
from grebe.links.instruments.sources import InstrumentSource, open_source

# The most readings that can wait: some minutes of the fastest instrument.
MOST_WAITING = 20_000
# An instrument is silent after the longer of this time [s] and this many of its periods without a
# reading.
SILENT_S, SILENT_PERIODS = 10.0, 5.0
# The first and the longest interval between two attempts to open a line [s].
RETRY_S, LONGEST_RETRY_S = 1.0, 15.0
# For an instrument's clock: the number of readings of which the fastest counts, and the least
# change that means that the clock was set [s].
CLOCK_READINGS, CLOCK_JUMP_S = 100, 5.0


class OwnClock:
    """Converts an instrument's clock to ours: the reading that came soonest after its time stamp is
    taken to have had no delay, and the others have waited somewhere.
    """

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=CLOCK_READINGS)

    def age_s(self, stamp: float, arrived: float) -> float:
        """Return the age [s] of a reading with a time `stamp` that `arrived` at our time [s]."""
        offset = arrived - stamp
        if self._offsets and abs(offset - min(self._offsets)) > CLOCK_JUMP_S:
            self._offsets.clear()
        self._offsets.append(offset)
        return offset - min(self._offsets)


@dataclass(frozen=True, kw_only=True)
class _Queued:
    measured_s: float
    decoded: DecodedReading


class Instrument:
    """One instrument at an address, called `name` in messages. Its thread starts at once and ends
    with `close`.
    """

    def __init__(self, address: str, name: str, profile: Profile, quantities: Quantities) -> None:
        self.address, self.name, self.profile = address, name, profile
        self._quantities = quantities
        self._queue: deque[_Queued] = deque(maxlen=MOST_WAITING)
        self._notes: deque[tuple[str, str]] = deque(maxlen=100)
        self._clock = OwnClock()
        self._source: InstrumentSource | None = None
        self._stopping = threading.Event()
        self._last_s = time.monotonic()
        self._is_sending = False
        self._broken = ""
        self._thread = threading.Thread(target=self._run, name=f"instrument {name}", daemon=True)
        self._thread.start()

    @property
    def keys(self) -> tuple[str, ...]:
        """The quantities that it may measure."""
        return self.profile.keys

    @property
    def state(self) -> str:
        """The state of the instrument, in words."""
        source = self._source
        if self._broken:
            return self._broken
        if source is None:
            return "the line is not open yet"
        counts = source.counts
        text = f"{counts.readings} readings, {counts.damaged} damaged"
        return text + (f"; not kept: {', '.join(counts.unused)}" if counts.unused else "")

    @property
    def is_broken(self) -> bool:
        """Whether its line could not be opened, or broke, or the instrument fell silent."""
        return bool(self._broken)

    @property
    def is_open(self) -> bool:
        """Whether its line has been opened; it may have broken since."""
        return self._source is not None

    @property
    def is_sending(self) -> bool:
        """Whether readings come."""
        return self._is_sending

    def readings(self) -> list[Reading]:
        """Return the readings since the last call, in order."""
        now_s = time.monotonic()
        taken: list[Reading] = []
        while self._queue:
            one = self._queue.popleft()
            taken.append(Reading(age_s=max(0.0, now_s - one.measured_s), values=one.decoded.values))
        return taken

    def notes(self) -> list[tuple[str, str]]:
        """Return notes for the operator, a code and a sentence each."""
        return [self._notes.popleft() for _ in range(len(self._notes))]

    def close(self) -> None:
        """End the thread and close the line."""
        self._stopping.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        retry_s = RETRY_S
        while not self._stopping.is_set():
            before = self._is_sending
            try:
                self._listen()
                broke = f"no reading for {self._silence_s:.0f} s"
            # The thread survives every error: nothing else would read the instrument again.
            except Exception as error:
                broke = str(error).rstrip(".") or type(error).__name__
            if self._stopping.is_set():
                return
            retry_s = RETRY_S if before or self._is_sending else min(2 * retry_s, LONGEST_RETRY_S)
            self._note_silence(broke)
            self._stopping.wait(retry_s)

    def _listen(self) -> None:
        """Read until the instrument falls silent, the line breaks, or the thread has to end."""
        source = self._source = open_source(self.address, self.profile, self._quantities)
        try:
            self._last_s = time.monotonic()
            for decoded in source.readings(self._stopping.is_set):
                now_s = time.monotonic()
                if decoded is None:
                    if now_s - self._last_s > self._silence_s:
                        return
                    continue
                self._last_s = now_s
                self._take(decoded, now_s)
        finally:
            source.close()

    def _take(self, decoded: DecodedReading, now_s: float) -> None:
        if not self._is_sending:
            if self._broken:
                self._notes.append(("instrument_again", f"{self.name} sends readings again"))
            self._is_sending, self._broken = True, ""
        late_s = self.profile.late_s
        if decoded.stamp is not None:
            late_s += self._clock.age_s(decoded.stamp, now_s)
        self._queue.append(_Queued(measured_s=now_s - late_s, decoded=decoded))

    @property
    def _silence_s(self) -> float:
        asked = self.profile.text or self.profile.modbus
        every_s = asked.every_s if asked is not None else 1.0
        return max(SILENT_S, SILENT_PERIODS * every_s)

    def _note_silence(self, why: str) -> None:
        if self._is_sending or not self._broken:
            self._notes.append(("instrument_silent", f"{self.name} at {self.address}: {why}"))
        self._is_sending, self._broken = False, why


class InstrumentSet:
    """Several instruments as one; see `grebe.links.base.Instruments`."""

    def __init__(self, instruments: Sequence[Instrument]) -> None:
        self.each = tuple(instruments)

    @property
    def keys(self) -> tuple[str, ...]:
        """The quantities that any of them may measure, each once."""
        return tuple(dict.fromkeys(key for one in self.each for key in one.keys))

    @property
    def silent(self) -> tuple[str, ...]:
        """See `Instruments`."""
        return tuple(one.name for one in self.each if not one.is_sending)

    def readings(self) -> list[Reading]:
        """See `Instruments`."""
        return [reading for one in self.each for reading in one.readings()]

    def notes(self) -> list[tuple[str, str]]:
        """See `Instruments`."""
        return [note for one in self.each for note in one.notes()]

    def close(self) -> None:
        """See `Instruments`."""
        for one in self.each:
            one.close()
