"""Lines to a stand-in autopilot: one in memory with its own time and with faults of a radio, and
one over UDP in real time.

The line in memory is deterministic: waiting on it lets the stand-in sail on until something
arrives.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from grebe.core.errors import UsageError
from grebe.links.mavlink.standin import StandIn
from grebe.links.wires import UdpWire
from grebe.simulation.autopilot import STEP_S


@dataclass(frozen=True, kw_only=True)
class RadioFaults:
    """The faults of a line: the share of messages lost, the delay [s] in each direction, its spread
    [s], by which messages overtake each other, and a period of silence (from, until) [s].
    """

    lost_share: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    silence: tuple[float, float] = (math.inf, math.inf)
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.lost_share < 1 or min(self.delay_s, self.jitter_s) < 0:
            raise UsageError("The share of lost messages must be 0 to 1, and delays 0 or more.")


NO_RADIO_FAULTS = RadioFaults()


class MemoryWire:
    """A wire to a stand-in that sails while the caller waits; its clock is that of the stand-in.

    `watch` is called with the stand-in after each of its steps.
    """

    def __init__(
        self,
        standin: StandIn,
        radio: RadioFaults = NO_RADIO_FAULTS,
        watch: Callable[[StandIn], None] = lambda _: None,
    ) -> None:
        self._standin = standin
        self._radio = radio
        self._watch = watch
        self._random = np.random.default_rng(radio.seed)
        self._to_us: list[tuple[float, int, bytes]] = []
        self._to_boat: list[tuple[float, int, bytes]] = []
        self._count = 0

    @property
    def for_others(self) -> str:
        """See `Wire`: no other process has access to this memory."""
        return ""

    def now_s(self) -> float:
        """See `Wire`."""
        return self._standin.autopilot.time_s

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        self._put(self._to_boat, data)

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`; the stand-in sails on until something arrives or the time is up."""
        end_s = self.now_s() + timeout_s
        while not (arrived := self._arrived(self._to_us)) and self.now_s() < end_s - 1e-9:
            self.sail()
        return arrived

    def sail(self) -> None:
        """Advance the stand-in by one of its steps."""
        heard = self._arrived(self._to_boat)
        if heard:
            self._standin.receive(heard)
        self._standin.autopilot.advance(STEP_S)
        self._watch(self._standin)
        for said in self._standin.due_messages():
            self._put(self._to_us, said)

    def close(self) -> None:
        """See `Wire`; `sail` can still advance the stand-in."""

    def _put(self, queue: list[tuple[float, int, bytes]], data: bytes) -> None:
        radio, now_s = self._radio, self.now_s()
        silent = radio.silence[0] <= now_s < radio.silence[1]
        if silent or self._random.uniform() < radio.lost_share:
            return
        late_s = radio.delay_s + radio.jitter_s * self._random.uniform()
        self._count += 1
        heapq.heappush(queue, (now_s + late_s, self._count, data))

    def _arrived(self, queue: list[tuple[float, int, bytes]]) -> bytes:
        arrived = b""
        while queue and queue[0][0] <= self.now_s() + 1e-9:
            arrived += heapq.heappop(queue)[2]
        return arrived


def serve(standin: StandIn, wire: UdpWire, stopped: Callable[[], bool], speed: float = 1.0) -> None:
    """Run a stand-in in real time (or `speed` times as fast) that communicates over UDP."""
    began_s, sailed_s = time.monotonic(), standin.autopilot.time_s
    while not stopped():
        wanted_s = sailed_s + speed * (time.monotonic() - began_s)
        while standin.autopilot.time_s < wanted_s:
            standin.autopilot.advance(STEP_S)
            for said in standin.due_messages():
                wire.send(said)
        heard = wire.receive(0.25 * STEP_S / speed)
        if heard:
            standin.receive(heard)
            for said in standin.due_messages():
                wire.send(said)
