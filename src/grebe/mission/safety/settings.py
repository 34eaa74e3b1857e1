"""Safety settings: how careful a mission is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime

from grebe.core.errors import UsageError


@dataclass(frozen=True, kw_only=True)
class SafetySettings:
    """The settings by which the boat's safety is judged.

    `fence` says whether the boat is kept in the survey's water. `reaction_s` is the time from an
    estimate to the resulting thrust, besides the estimate's age and the thrusters' lag: a period of
    the loop, the computation of a step, and the transfer over the link. For braking, the weaker
    thruster is trusted with `weaker_share` of its full thrust. A boat braked at the fence more than
    `fence_tries` times before it reaches a target goes home.

    `home` is (longitude, latitude), by default the survey's start. The boat must be home within
    `max_s` [s] of the mission's first estimate, and by the instant `until`. `battery_reserve` is
    the share of the battery that must be left then. `battery_wh` is the capacity of a battery whose
    share the boat does not report, and `used_wh` the energy used before (None: what the recorded
    track shows since the boat left its harbour). The predicted time home is increased by
    `home_share` of it and by `home_slack_s`. `comes_home` gives the reason of a mission that only
    goes home, and is empty for a survey.

    The mission ends after `blind_s` without a usable estimate. Water of less than `least_depth_m`
    below the sonar is too shallow. A stuck boat goes astern up to `tries` times, for `astern_s`
    each. A current may be stronger than the boat for `against_s`. A place is held within
    `hold_radius_m`. The survey waits for an instrument that has been silent for `mute_s`, for ever
    if need be: water that is sailed without it must be sailed again.
    """

    fence: bool = True
    reaction_s: float = 0.3
    weaker_share: float = 0.9
    fence_tries: int = 3
    home: tuple[float, float] | None = None
    max_s: float = math.inf
    until: datetime | None = None
    battery_reserve: float = 0.2
    battery_wh: float | None = None
    used_wh: float | None = None
    home_share: float = 0.25
    home_slack_s: float = 30.0
    comes_home: str = ""
    blind_s: float = 60.0
    least_depth_m: float = 0.3
    tries: int = 3
    astern_s: float = 5.0
    against_s: float = 20.0
    hold_radius_m: float = 3.0
    mute_s: float = 20.0

    def __post_init__(self) -> None:
        if not 0 <= self.battery_reserve < 1:
            raise UsageError(
                f"A battery reserve of {self.battery_reserve:g} is impossible; give a share from 0 "
                "to less than 1.",
                settings=("battery_reserve",),
            )
        if self.used_wh is not None and not 0 <= self.used_wh < math.inf:
            raise UsageError(f"A battery cannot have supplied {self.used_wh:g} Wh; give 0 or more.")
        if self.battery_wh is not None and not 0 < self.battery_wh < math.inf:
            raise UsageError(
                f"A battery of {self.battery_wh:g} Wh is impossible; give more than 0.",
                settings=("battery_wh",),
            )
        if not self.max_s > 0:
            raise UsageError(
                f"A mission of {self.max_s / 60:g} minutes is impossible; give more than 0.",
                settings=("max_minutes",),
            )
        if self.until is not None and self.until.tzinfo is None:
            raise UsageError(
                f"{self.until} has no time zone; give a time in UTC.", settings=("until",)
            )
        if not 0 < self.weaker_share <= 1:
            raise UsageError(
                f"A thruster's share of its thrust must be 0 to 1, not {self.weaker_share:g}."
            )
        lengths = (self.reaction_s, self.home_share, self.home_slack_s, self.least_depth_m)
        if not min(lengths) >= 0:
            raise UsageError("Reaction, reserves and the least depth must not be negative.")
        spans = (self.blind_s, self.astern_s, self.against_s, self.hold_radius_m, self.mute_s)
        if not all(span > 0 for span in spans) or min(self.tries, self.fence_tries) < 1:
            raise UsageError("Times, tries and the radius of safety settings must be positive.")

    @property
    def watches_home(self) -> bool:
        """Whether the route home must be known at every estimate."""
        return self.max_s < math.inf or self.until is not None or self.battery_wh is not None


CAREFUL = SafetySettings()
# For trials in open water, without a survey's outline.
NO_FENCE = SafetySettings(fence=False)
