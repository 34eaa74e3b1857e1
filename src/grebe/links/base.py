"""What a mission needs of a boat: the interface that every boat link implements.

The complete contract:

- **Frame.** Positions are metres north and east in the survey's local frame; heading is
  clockwise from north; surge, sway and yaw rate are over ground, yaw rate positive to starboard.
- **Heading.** It may be wrapped to any turn or not at all: the mission unwraps it.
- **Time.** `time_s` counts from the opening of the link and never runs back. It is the link's own:
  the seconds of a simulated boat pass as fast as they are computed. `age_s` says how long before
  `time_s` the boat was in that state; the mission predicts the state forward.
- **Orders** hold until the next one. An order states the same thing twice: as thrusts at the
  propellers, within the vessel's limits, and as the motion to which they lead. A link uses what its
  boat can follow. Bare thrusters follow the thrusts (`Vessel.throttle_of` converts newtons to
  commands of an actuator), and an autopilot that holds speed and yaw rate follows the motion.
- **Errors.** `LinkError` means that the boat no longer answers and will not answer again. A single
  estimate that is missing or not finite is no error; the mission waits for the next one.
- **The end.** After `close` the boat has no thrust and `observe` raises `LinkError`; closing
  again does nothing.

A link knows nothing of targets or maps. `tests/contracts/test_links.py` tests every link for this
contract.
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
    """A state estimate z in the survey's frame.

    `time_s` is when the link returns it, counted from the opening of the link; the boat was in that
    state `age_s` before.
    """

    time_s: float
    state: State
    age_s: float = 0.0


# The state that a link returns if it does not know where the boat is.
NOT_A_STATE: State = (math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@dataclass(frozen=True, kw_only=True)
class Order:
    """What the boat does until the next order.

    `thrusts` (F_1 port, F_2 starboard) [N]; `surge_mps` and `yaw_rate_radps`, over ground, are the
    motion to hold for a boat that is steered by its motion instead.
    """

    thrusts: tuple[float, float]
    surge_mps: float
    yaw_rate_radps: float


IDLE = Order(thrusts=(0.0, 0.0), surge_mps=0.0, yaw_rate_radps=0.0)


@dataclass(frozen=True, kw_only=True)
class BoatStatus:
    """The condition of the boat, apart from its state.

    `mode` is in the autopilot's own words. `battery_share`, from 0 to 1, and `fix`, in words, are
    given if known. `age_s` is that of the last message. `stop_request` says who wants the mission
    to end (the pilot took over, a key on the boat), and is empty otherwise.
    """

    mode: str
    armed: bool
    battery_share: float | None = None
    fix: str = ""
    age_s: float = 0.0
    stop_request: str = ""


class BoatLink(Protocol):
    """A boat that can be observed and commanded, and that measures.

    `source` says where the readings come from, for the survey's metadata.
    """

    @property
    def source(self) -> str:
        """Where the readings come from, in words."""
        ...

    def observe(self) -> Observation:
        """Wait for the next state estimate and return it; `LinkError` if none comes."""
        ...

    def command(self, order: Order) -> None:
        """Follow an order until the next one."""
        ...

    def measure(self) -> Mapping[str, float]:
        """Return the newest reading of the sonde, keyed by quantity; empty if there is none."""
        ...

    def status(self) -> BoatStatus:
        """Return the condition of the boat, without waiting."""
        ...

    def stop(self) -> None:
        """Remove all thrust at once; the link stays open."""
        ...

    def close(self) -> None:
        """Leave the boat without thrust and release it."""
        ...


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Values by quantity that an instrument with its own connection measured `age_s` ago."""

    age_s: float
    values: Mapping[str, float]


class Instruments(Protocol):
    """Sondes with their own connections, which measure the quantities `keys` at their own rate."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The quantities that they may measure."""
        ...

    @property
    def silent(self) -> Sequence[str]:
        """The names of the instruments that send no readings."""
        ...

    def readings(self) -> Sequence[Reading]:
        """Return the readings since the last call, without waiting."""
        ...

    def notes(self) -> Sequence[tuple[str, str]]:
        """Return notes for the operator, a code and a sentence each, without waiting."""
        ...

    def close(self) -> None:
        """Close the connections."""
        ...


@dataclass(frozen=True, kw_only=True)
class AsDriven:
    """A boat as it is steered over a link: with an autopilot's inner loops, the hull is another
    plant than without.

    `model` is the boat to plan for, None for the survey's own. `holds_motion`: an autopilot holds
    the speed and yaw rate of an order whatever its thrusts, so the boat cannot be judged by their
    effect. `braking_share` is the share of the model's reverse thrust that can be trusted for
    braking.
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
    """Return the boat as it is driven over a link, by default as in the survey."""
    return link.as_driven if isinstance(link, DrivenLink) else AsDriven()
