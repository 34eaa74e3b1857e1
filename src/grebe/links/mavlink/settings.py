"""The settings of a MAVLink boat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from grebe.core.errors import UsageError

Drive = Literal["motion", "sticks"]


@dataclass(frozen=True, kw_only=True)
class MavlinkSettings:
    """The settings of a MAVLink boat.

    `drive` says what orders become. After `silence_s` without a message the line counts as lost.
    `find_s` is how long to wait for an autopilot, and `settle_s` how long to wait until it knows
    where it is. `system` is the autopilot's number, 0 for the first one heard. The lags [s] are
    those of the autopilot's inner loops, None if unknown.

    Raises `UsageError` for impossible values.
    """

    drive: Drive = "motion"
    silence_s: float = 15.0
    find_s: float = 10.0
    settle_s: float = 60.0
    system: int = 0
    surge_lag_s: float | None = None
    yaw_lag_s: float | None = None

    def __post_init__(self) -> None:
        if self.drive not in ("motion", "sticks"):
            raise UsageError(f"A boat is driven by motion or by sticks, not by {self.drive!r}.")
        if not min(self.silence_s, self.find_s, self.settle_s) > 0:
            raise UsageError("Time-outs of a MAVLink line must be longer than 0 s.")
        if not 0 <= self.system <= 255:
            raise UsageError(f"A MAVLink system's number must be 1 to 255, not {self.system}.")
