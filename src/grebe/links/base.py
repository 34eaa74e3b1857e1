"""What a mission needs of a boat: the port that every boat link fills.

The contract, in full:

- **Frame.** Positions are metres north and east in the survey's local frame; heading is
  clockwise from north; surge, sway and yaw rate are over ground, yaw rate positive to starboard.
- **Heading.** It may be wrapped to any turn or not at all: the mission unwraps it.
- **Time.** `time_s` counts from when the link was opened and never runs back. It is the link's
  own: the seconds of a simulated boat pass as fast as they are computed. `age_s` says how long
  before `time_s` the boat was in that state; who steers predicts it forward.
- **Orders** hold until the next one. An order says the same twice: the thrusts at the propellers,
  within the vessel's limits, and the motion that they lead to. A link takes what its boat can
  follow: bare thrusters the thrusts (how newtons become commands of an actuator is the vessel's
  knowledge, `Vessel.throttle_of`), an autopilot that holds speed and yaw rate the motion.
- **Trouble.** `LinkError` means that the boat no longer answers and will not; a single estimate
  that is missing or not finite is no error, and the next one is waited for.
- **The end.** After `close` the boat has no thrust and `observe` raises `LinkError`; closing
  again does nothing.

A link knows nothing of targets or maps. `tests/contracts/test_links.py` holds every link to this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from grebe.core.events import State
from grebe.core.vessel import Vessel


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A state estimate z in the survey's frame, as it is handed over.

    `time_s` is when it is handed over, since the link was opened; the boat was in that state
    `age_s` before.
    """

    time_s: float
    state: State
    age_s: float = 0.0


# What a link hands out as a state that does not know where the boat is.
NOT_A_STATE: State = (math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the boat is told until the next order.

    `thrusts` (F_1 port, F_2 starboard) [N]; `surge_mps` and `yaw_rate_radps`, over ground, are
    what a boat is to hold that is steered by its motion instead.
    """

    thrusts: tuple[float, float]
    surge_mps: float
    yaw_rate_radps: float


IDLE = Order(thrusts=(0.0, 0.0), surge_mps=0.0, yaw_rate_radps=0.0)


@dataclass(frozen=True, kw_only=True)
class BoatStatus:
    """How the boat is, apart from where it is.

    `mode` in the autopilot's own words; `battery_share` 0 to 1 and `fix` in words where they
    are known; `age_s` of the last message; `stop_request` says who wants the mission to end
    (the pilot took over, a key on the boat), and is empty otherwise.
    """

    mode: str
    armed: bool
    battery_share: float | None = None
    fix: str = ""
    age_s: float = 0.0
    stop_request: str = ""


class BoatLink(Protocol):
    """A boat that can be observed, commanded and asked for a measurement.

    `source` says where the readings come from, for the survey's metadata.
    """

    @property
    def source(self) -> str:
        """Where the readings come from, in words."""
        ...

    def observe(self) -> Observation:
        """Wait for the next state estimate and return it; `LinkError` when none comes."""
        ...

    def command(self, order: Order) -> None:
        """Follow an order until the next one."""
        ...

    def measure(self) -> Mapping[str, float]:
        """Return the newest reading of the sonde, keyed by quantity; empty when none."""
        ...

    def status(self) -> BoatStatus:
        """Return how the boat is, without waiting."""
        ...

    def stop(self) -> None:
        """Take all thrust away at once; the link stays open."""
        ...

    def close(self) -> None:
        """Leave the boat without thrust and give it back."""
        ...


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What an instrument apart from the boat measured `age_s` ago: values by quantity."""

    age_s: float
    values: Mapping[str, float]


class Instruments(Protocol):
    """Sondes apart from the boat, which measure at their own rate; `keys` says which quantities."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The quantities that they may measure."""
        ...

    @property
    def silent(self) -> Sequence[str]:
        """The names of those from which no readings come."""
        ...

    def readings(self) -> Sequence[Reading]:
        """Hand out what has come since the last call, without waiting."""
        ...

    def notes(self) -> Sequence[tuple[str, str]]:
        """Hand out what an operator should know, a code and a sentence each, without waiting."""
        ...

    def close(self) -> None:
        """Let go of their lines."""
        ...


@dataclass(frozen=True, kw_only=True)
class AsDriven:
    """What a boat is to whoever steers it over a link: the hull under an autopilot's inner loops is
    another plant than the hull.

    `model` is the boat as it should be taken to be, None for the survey's own. `holds_motion`: an
    autopilot holds the speed and yaw rate of an order, whatever its thrusts, and the boat cannot be
    judged by what these do. `braking_share`: the share of its model's thrust astern that it can be
    trusted to brake with.
    """

    model: Vessel | None = None
    holds_motion: bool = False
    braking_share: float = 1.0


@runtime_checkable
class DrivenLink(Protocol):
    """A link that knows the boat better than the survey does."""

    @property
    def as_driven(self) -> AsDriven:
        """The boat as it is driven over this link."""
        ...


def as_driven(link: BoatLink) -> AsDriven:
    """The boat as it is driven over a link: what the link says, or else as the survey has it."""
    return link.as_driven if isinstance(link, DrivenLink) else AsDriven()
