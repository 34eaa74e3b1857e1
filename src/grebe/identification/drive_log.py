"""The log of a drive: the boat's positions and motion, and the commands of its thrusters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from grebe.core.errors import InputError
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CommandUnit = Literal["newton", "throttle"]
SHORTEST_S = 30.0
# Least number of rows with a heading each second, so that no turn is missed between two of them.
SPARSEST_HZ = 1.0
# Commands must vary by more than this share of the largest; otherwise they excite nothing.
LEAST_SPREAD = 0.05
LARGEST_SPEED_MPS = 20.0


@dataclass(frozen=True, kw_only=True)
class DriveLog:
    """States and commands of one drive, on one clock.

    `times` (n,) [s] do not decrease. `states` (n, 6) are as in `grebe.core.dynamics`, heading
    unwrapped, velocities over ground, NaN for values that were not measured at a time. `commands`
    (m, 2), port and starboard, hold from `command_times` (m,) [s] to the next; they are newtons, or
    throttles from -1 to 1. Raises `InputError` for a log from which no boat can be identified.
    """

    name: str
    times: Array
    states: Array
    command_times: Array
    commands: Array
    unit: CommandUnit

    def __post_init__(self) -> None:
        self._check_shapes()
        self._check_states()
        self._check_commands()

    def _check_shapes(self) -> None:
        n, m = len(self.times), len(self.command_times)
        if self.states.shape != (n, 6) or self.commands.shape != (m, 2):
            raise InputError(
                f"{self.name}: {n} times need states of shape ({n}, 6), and {m} command times "
                f"need commands of shape ({m}, 2); the shapes are {self.states.shape} and "
                f"{self.commands.shape}."
            )
        if m == 0:
            raise InputError(
                f"{self.name} holds no thruster commands; without them a heavy boat cannot be "
                "told from a weak one."
            )
        for what, times in (("states", self.times), ("commands", self.command_times)):
            if not np.isfinite(times).all() or (np.diff(times) < 0).any():
                raise InputError(f"{self.name}: the times of the {what} are not in order.")

    def _check_states(self) -> None:
        measured = np.isfinite(self.states)
        if not (measured[:, 2].any() and (measured[:, :2].any() or measured[:, 3].any())):
            raise InputError(
                f"{self.name} has no heading, or neither positions nor velocities that are numbers."
            )
        if self.duration_s < SHORTEST_S:
            raise InputError(
                f"{self.name} lasts {self.duration_s:.0f} s; identifying a boat takes at least "
                f"{SHORTEST_S:.0f} s, better three minutes of steps and turns."
            )
        if measured[:, 2].sum() < SPARSEST_HZ * self.duration_s:
            raise InputError(
                f"{self.name} has a heading only every "
                f"{self.duration_s / max(1, int(measured[:, 2].sum())):.1f} s; log one at least "
                "every second, better every 0.1 s."
            )
        fastest = float(np.nanmax(np.abs(self.states[:, 3:5]), initial=0.0))
        if fastest > LARGEST_SPEED_MPS:
            raise InputError(
                f"{self.name}: velocities reach {fastest:g}, but no survey boat makes "
                f"{LARGEST_SPEED_MPS:g} m/s; give them in metres a second."
            )

    def _check_commands(self) -> None:
        if not np.isfinite(self.commands).all():
            raise InputError(f"{self.name}: a thruster command is not a number.")
        largest = float(np.abs(self.commands).max())
        if self.unit == "throttle" and largest > 1.0 + 1e-6:
            raise InputError(
                f"{self.name}: throttles reach {largest:g}; give them as shares of full "
                "throttle, -1 to 1."
            )
        during = self.command_times <= self.times[-1]
        spread = np.ptp(self.commands[during], axis=0) if during.any() else np.zeros(2)
        if float(spread.max()) <= LEAST_SPREAD * largest or largest == 0:
            raise InputError(
                f"{self.name}: the thruster commands never change; log a drive that speeds up, "
                "coasts and turns."
            )

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last [s]."""
        return float(self.times[-1] - self.times[0]) if len(self.times) else 0.0

    def in_throttles(self, vessel: Vessel) -> DriveLog:
        """The same log with throttles as commands; newtons are converted by the vessel's curve."""
        if self.unit == "throttle":
            return self
        shares = [[vessel.throttle_of(float(f)) for f in row] for row in self.commands]
        return replace(self, commands=np.array(shares), unit="throttle")

    def between(self, begin_s: float, end_s: float) -> DriveLog:
        """The part from `begin_s` to `end_s`, in seconds since the first row."""
        first = self.times[0]
        rows = (self.times >= first + begin_s) & (self.times <= first + end_s)
        return replace(self, times=self.times[rows], states=self.states[rows])


def unwrapped(heading: Array) -> Array:
    """Unwrap headings (n,) [rad]; NaN values stay in place."""
    known = np.isfinite(heading)
    out = heading.copy()
    out[known] = np.unwrap(heading[known])
    return out
