"""Whoever steers: the port that a mission has for its controller."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from grebe.control.apart import Announced
from grebe.control.controller import Command
from grebe.control.slow_thrusters import SlowThrusters
from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError
from grebe.core.events import State
from grebe.core.vessel import Vessel


class Helm(Protocol):
    """Whoever steers: Grebe's `Controller`, or a peer.

    The mission sets `reached` (Definition 5) before it asks; `step` is asked every `step_s`.
    """

    reached: int

    @property
    def vessel(self) -> Vessel:
        """The boat as it is believed to be."""
        ...

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        ...

    def step(self, state: State, weather: Weather, elapsed_s: float | None) -> Command:
        """Return what to do from `state` in `weather`, so long after the last step."""
        ...


@runtime_checkable
class AdaptableHelm(Protocol):
    """A helm that can switch to a corrected vessel under way."""

    def take_for(self, vessel: Vessel) -> None:
        """Plan for another boat from now on."""
        ...


@runtime_checkable
class ForeseeingHelm(Protocol):
    """A helm that can allow for thrusters that lag."""

    def expect(self, thrusters: SlowThrusters | None) -> None:
        """Plan the next step for these thrusters; None for such as answer at once."""
        ...


@runtime_checkable
class HeedingHelm(Protocol):
    """A helm whose plans can keep apart from others."""

    def heed(self, others: Sequence[Announced], apart_m: float) -> None:
        """Plan the next step `apart_m` [m] from where these have announced to be."""
        ...


def step_of(helm: Helm) -> float:
    """The time between two steps of a helm [s]; `UsageError` where there would be none."""
    step_s = float(helm.step_s)
    if not 0 < step_s < math.inf:
        raise UsageError(
            f"A helm that is asked every {step_s:g} s steers nothing; give more than 0."
        )
    return step_s


def possible_thrusts(vessel: Vessel, thrusts: Sequence[float]) -> tuple[float, float]:
    """Thrusts (F_1, F_2) [N] within the vessel's limits; `UsageError` for what are none."""
    try:
        port, starboard = map(float, thrusts)
    except (TypeError, ValueError):
        raise UsageError(f"A helm's thrusts are two numbers [N], not {thrusts!r}.") from None
    if not (math.isfinite(port) and math.isfinite(starboard)):
        raise UsageError(f"A helm's thrusts are finite numbers [N], not {thrusts!r}.")
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    return min(max(port, low), high), min(max(starboard, low), high)
