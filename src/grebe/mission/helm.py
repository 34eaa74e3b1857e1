"""The helm: the interface between a mission and the controller that steers the boat."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from grebe.control.controller import Command
from grebe.control.separation import AnnouncedPath
from grebe.control.slow_thrusters import SlowThrusters
from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError
from grebe.core.events import State
from grebe.core.vessel import Vessel


class Helm(Protocol):
    """What steers the boat: Grebe's `Controller`, or a peer.

    The mission calls `step` every `step_s`, after it has set `reached` (Definition 5).
    """

    reached: int

    @property
    def vessel(self) -> Vessel:
        """The boat that the helm plans for."""
        ...

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        ...

    def step(self, state: State, weather: Weather, elapsed_s: float | None) -> Command:
        """Return the command at `state` in `weather`, `elapsed_s` [s] after the last step; None
        if there was none.
        """
        ...


@runtime_checkable
class AdaptableHelm(Protocol):
    """A helm that can switch to a corrected vessel during the mission."""

    def take_for(self, vessel: Vessel) -> None:
        """Plan for `vessel` from now on."""
        ...


@runtime_checkable
class ForeseeingHelm(Protocol):
    """A helm that can allow for thrusters that lag."""

    def expect(self, thrusters: SlowThrusters | None) -> None:
        """Plan the next step for these thrusters; None for thrusters without lag."""
        ...


@runtime_checkable
class TrafficAwareHelm(Protocol):
    """A helm whose plans can keep a distance from other boats."""

    def heed(self, others: Sequence[AnnouncedPath], apart_m: float) -> None:
        """Plan the next step at least `apart_m` [m] from the announced positions of the others."""
        ...


def step_of(helm: Helm) -> float:
    """Return the time between two steps of a helm [s]; `UsageError` unless it is positive and
    finite.
    """
    step_s = float(helm.step_s)
    if not 0 < step_s < math.inf:
        raise UsageError(f"A helm's step must be above 0 s, not {step_s:g} s.")
    return step_s


def possible_thrusts(vessel: Vessel, thrusts: Sequence[float]) -> tuple[float, float]:
    """Return the thrusts (F_1, F_2) [N] clipped to the vessel's limits; `UsageError` unless they
    are two finite numbers.
    """
    try:
        port, starboard = map(float, thrusts)
    except (TypeError, ValueError):
        raise UsageError(f"A helm's thrusts must be two numbers [N], not {thrusts!r}.") from None
    if not (math.isfinite(port) and math.isfinite(starboard)):
        raise UsageError(f"A helm's thrusts must be finite numbers [N], not {thrusts!r}.")
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    return min(max(port, low), high), min(max(starboard, low), high)
