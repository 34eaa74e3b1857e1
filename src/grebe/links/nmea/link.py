"""The link to a boat that sends position and heading by NMEA 0183, and takes thrusts as JSON.

Each position makes one estimate; if positions are rare, a heading in between makes one too. The
link's time is that of the sentences. The link has no thread: it sends the lines that keep the boat
going while the mission waits for the next estimate. A mission that hangs therefore falls silent,
and the boat's own receiver removes the thrust (`thrusts.RECEIVER_S`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress

from grebe.core.errors import LinkError
from grebe.core.events import State
from grebe.core.frames import LocalFrame
from grebe.core.vessel import Vessel
from grebe.links.base import IDLE, NOT_A_STATE, BoatStatus, Observation, Order
from grebe.links.nmea.clock import StreamClock
from grebe.links.nmea.navigation import Navigator
from grebe.links.nmea.sentences import (
    Heading,
    NoFix,
    Position,
    Reading,
    Record,
    TurnRate,
    Variation,
    Velocity,
    read_sentence,
)
from grebe.links.nmea.settings import NmeaSettings, open_wire
from grebe.links.nmea.thrusts import KEEP_ALIVE_S, thrust_line
from grebe.links.wires import Wire

# After this long since the last estimate, a heading makes an estimate without a position [s].
BETWEEN_S = 0.09
# After this long without a position or a heading there is no estimate, and no thrust [s].
BLIND_S = 1.5
# How often a blind boat returns an estimate that is not a number [s].
SAY_BLIND_S = 0.5
# The oldest reading of a probe that is returned [s].
STALE_READING_S = 5.0
# A datagram may end with the sum of its last sentence, without a newline.
WHOLE = re.compile(rb"\*[0-9A-Fa-f]{2}\s*$")
LONGEST_PART = 4096


class NmeaLink:
    """`BoatLink` over two wires, or one for both; `open_nmea` makes one that has a position.

    `sentences` counts the intact sentences, and `damaged` the others.
    """

    def __init__(
        self,
        source: Wire,
        out: Wire,
        frame: LocalFrame,
        vessel: Vessel,
        settings: NmeaSettings,
    ) -> None:
        self.source = f"nmea, {settings.source}"
        self.sentences = self.damaged = 0
        self._in, self._out = source, out
        self._vessel = vessel
        self._settings = settings
        variation = settings.variation_deg
        self._navigator = Navigator(
            frame, vessel, None if variation is None else math.radians(variation)
        )
        self._clock = StreamClock(settings.late_s)
        self._part = b""
        self._fix = "no position yet"
        self._readings: dict[str, tuple[float, float]] = {}
        self._order = IDLE
        self._seq = 0
        self._told = self._closed = False
        self._told_s = -math.inf
        self._heard_s = self._said_s = source.now_s()
        self._handed_s = -math.inf

    def find(self) -> None:
        """Wait for a first position and heading; `LinkError` says what is missing."""
        end_s = self._in.now_s() + self._settings.find_s
        while not all(map(math.isfinite, self._navigator.state(0.0))):
            if self._in.now_s() >= end_s:
                raise LinkError(self._missing())
            self._hear(KEEP_ALIVE_S)

    def observe(self) -> Observation:
        """See `BoatLink`; after `BLIND_S` without position or heading, states are not numbers."""
        if self._closed:
            raise LinkError("The NMEA boat has been closed.")
        if not self._told:
            self._tell()
        self._told = False
        while True:
            seen_s = self._hear(KEEP_ALIVE_S)
            now_s = self._in.now_s()
            if not math.isnan(seen_s):
                return self._seen(seen_s, now_s)
            if now_s - self._heard_s > self._settings.silence_s:
                raise LinkError(
                    f"{self.source}: no sentence came for {now_s - self._heard_s:.0f} s."
                )
            if self._blind(now_s) and now_s - self._said_s >= SAY_BLIND_S:
                self._order = IDLE
                return self._hand(NOT_A_STATE, self._clock.now(now_s), 0.0, now_s)
            if now_s - self._told_s >= KEEP_ALIVE_S:
                self._tell()

    def command(self, order: Order) -> None:
        """See `BoatLink`: sends the thrusts, not the motion."""
        self._order = order
        self._tell()

    def measure(self) -> Mapping[str, float]:
        """Return the readings of probes and sounders on the same line: temperature and depth."""
        now_s = self._in.now_s()
        return {
            key: value
            for key, (value, read_s) in self._readings.items()
            if now_s - read_s <= STALE_READING_S
        }

    def status(self) -> BoatStatus:
        """See `BoatLink`: sentences give no mode and no battery."""
        return BoatStatus(
            mode="nmea",
            armed=not self._closed,
            fix=self._fix,
            age_s=max(0.0, self._in.now_s() - self._heard_s),
        )

    def stop(self) -> None:
        """See `BoatLink`."""
        self.command(IDLE)

    def close(self) -> None:
        """Leave the boat without thrust. The line is sent three times because a datagram may be
        lost, and not at all if no line was sent before.
        """
        if self._closed:
            return
        self._closed = True
        # If the line is broken, the boat's own receiver removes the thrust.
        with suppress(LinkError):
            for _ in range(3 if self._seq else 0):
                self.stop()
        self._out.close()
        self._in.close()

    def _seen(self, seen_s: float, now_s: float) -> Observation:
        """Return the state at a time, with its age."""
        time_s = max(self._clock.now(now_s), seen_s)
        return self._hand(self._navigator.state(seen_s), time_s, time_s - seen_s, now_s)

    def _hand(self, state: State, time_s: float, age_s: float, now_s: float) -> Observation:
        """Return an estimate with a later time than the last one, whatever the clocks do."""
        later_s = max(time_s, math.nextafter(self._handed_s + 1e-6, math.inf))
        self._handed_s, self._said_s = later_s, now_s
        return Observation(time_s=later_s, state=state, age_s=age_s)

    def _blind(self, now_s: float) -> bool:
        time_s = self._clock.now(now_s) - self._settings.late_s
        seen = (self._navigator.position_s, self._navigator.heading_s)
        return any(time_s - seen_s > BLIND_S for seen_s in seen)

    def _tell(self) -> None:
        now_s = self._in.now_s()
        time_s = self._clock.now(now_s)
        line = thrust_line(self._vessel, self._order.thrusts, time_s, self._seq)
        self._out.send(line.encoded())
        self._seq += 1
        self._told, self._told_s = True, now_s

    def _hear(self, timeout_s: float) -> float:
        """Read what has come, waiting at most `timeout_s`; return the time [s] of a new estimate,
        or not a number if there is none.
        """
        data = self._in.receive(timeout_s)
        *lines, self._part = (self._part + data).split(b"\n")
        if WHOLE.search(self._part) or len(self._part) > LONGEST_PART:
            lines.append(self._part)
            self._part = b""
        now_s, placed, headed = self._in.now_s(), False, False
        for line in filter(None, map(bytes.strip, lines)):
            for one in self._read(line, now_s):
                news = self._take(one, now_s)
                placed |= news and isinstance(one, Position)
                headed |= news and isinstance(one, Heading)
        if self._blind(now_s):
            return math.nan
        if placed:
            return self._navigator.position_s
        seen_s = self._navigator.heading_s
        return seen_s if headed and seen_s - self._handed_s >= BETWEEN_S else math.nan

    def _read(self, line: bytes, now_s: float) -> tuple[Record, ...]:
        records = read_sentence(line)
        if records is None:
            self.damaged += 1
            return ()
        self.sentences += 1
        self._heard_s = now_s
        return records

    def _take(self, record: Record, now_s: float) -> bool:
        """Learn from a record; return whether it is a new position or heading."""
        navigator, clock = self._navigator, self._clock
        match record:
            case Position():
                time_s = clock.at(record.second_of_day, now_s)
                self._fix = record.fix or self._fix
                return time_s is not None and navigator.update_position(time_s, record)
            case Velocity():
                of_day = record.second_of_day
                time_s = clock.now(now_s) if of_day is None else clock.at(of_day, now_s)
                if time_s is not None:
                    navigator.update_velocity(time_s, record)
            case Heading():
                return navigator.update_heading(clock.now(now_s), record)
            case TurnRate():
                navigator.update_turn_rate(clock.now(now_s), record)
            case Variation():
                if self._settings.variation_deg is None:
                    navigator.variation_rad = record.east_rad
            case Reading():
                self._readings[record.key] = (record.value, now_s)
            case NoFix():
                self._fix = "no fix"
        return False

    def _missing(self) -> str:
        """Return why there is no state, as a message that helps to find the loose plug."""
        where, waited = self._settings.source, f"within {self._settings.find_s:g} s"
        if not self.sentences:
            damaged = f" ({self.damaged} damaged; check the line's speed)" if self.damaged else ""
            return f"No NMEA sentence came from {where} {waited}{damaged}."
        if math.isnan(self._navigator.position_s):
            return f"{where} speaks NMEA but gave no position {waited}: no GGA or RMC with a fix."
        return (
            f"{where} gave a position but no heading {waited}: no HDT, THS, HDG or HDM with a "
            "variation; a course over ground cannot replace it."
        )


def open_nmea(settings: NmeaSettings, frame: LocalFrame, vessel: Vessel) -> NmeaLink:
    """Open the lines and wait for a first state; `LinkError` if there is none."""
    source = open_wire(settings.source, speaks_first=False)
    try:
        out = open_wire(settings.out, speaks_first=True) if settings.out else source
    except LinkError:
        source.close()
        raise
    link = NmeaLink(source, out, frame, vessel, settings)
    try:
        link.find()
    except BaseException:
        link.close()
        raise
    return link
