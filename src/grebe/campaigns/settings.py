"""Settings of a campaign: the missions to simulate, the criterion of success, and the claim."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from grebe.campaigns.certificate import Claim
from grebe.campaigns.spread import OneOf, Spread, Value, spread_of
from grebe.core.errors import UsageError
from grebe.core.vessel import Vessel

# The settings that may differ from mission to mission, with their defaults. Directions are those
# towards which a current or a wind goes, clockwise from north.
DEFAULTS: Mapping[str, Value | tuple[float, float]] = {
    "current_mps": 0.0,
    "current_to_deg": (0.0, 360.0),
    "wind_n": 0.0,
    "wind_to_deg": (0.0, 360.0),
    "mismatch": 0.0,
    "position_noise_m": 0.0,
    "heading_noise_deg": 0.0,
    "velocity_noise_mps": 0.0,
    "lost_share": 0.0,
    "late_s": 0.0,
    "thruster_dies": 0.0,
    "blind_s": 0.0,
    "rule": "lookahead",
    "boat": "",
}
WORDS = {"rule", "boat"}
SHARES = {"mismatch", "lost_share", "thruster_dies"}
# Shares that must be less than 1: with all estimates lost, or a boat without mass, there is no
# mission.
BELOW_ONE = {"mismatch", "lost_share"}
# Largest plausible values for weather, a receiver or a compass.
MOST = {
    "current_mps": 10.0,
    "wind_n": 1e5,
    "position_noise_m": 100.0,
    "heading_noise_deg": 180.0,
    "velocity_noise_mps": 10.0,
    "late_s": 10.0,
    "blind_s": 3600.0,
}
SIGNED = {"current_to_deg", "wind_to_deg"}


@dataclass(frozen=True, kw_only=True)
class Success:
    """A mission succeeds when every target is reached `within_s`, and the boat's centre stays
    inside the survey's water, never nearer than `clearance_m` to its edge.
    """

    within_s: float
    clearance_m: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.within_s < math.inf:
            raise UsageError(
                f"A time limit of {self.within_s:g} s is impossible; give more than 0."
            )
        if not 0 <= self.clearance_m < math.inf:
            raise UsageError(
                f"A clearance of {self.clearance_m:g} m is impossible; give 0 or more."
            )


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """The settings of a campaign.

    It simulates at most `missions`, each drawn from the `spreads` by `seed` and its number; a
    setting without a spread has its default from `DEFAULTS`. `boats` are the vessels that the
    spread of `boat` names; an empty name is the survey's own vessel.
    """

    name: str
    success: Success
    claim: Claim
    missions: int = 1000
    seed: int = 1
    spreads: Mapping[str, Spread] = field(default_factory=dict[str, Spread])
    boats: Mapping[str, Vessel] = field(default_factory=dict[str, Vessel])

    def __post_init__(self) -> None:
        if self.missions < 1 or self.seed < 0:
            raise UsageError(
                f"{self.missions} missions with seed {self.seed} are impossible; give a positive "
                "number of missions, and a seed of 0 or more."
            )
        for name, spread in self.spreads.items():
            if name not in DEFAULTS:
                raise UsageError(
                    f"A campaign has no setting {name!r} to draw; choose from "
                    f"{', '.join(DEFAULTS)}."
                )
            _check(name, spread)

    def drawn(self, number: int) -> dict[str, Value]:
        """Return the settings of one mission, which are the same at every call and on any computer.

        Every setting has its own random stream, so one more spread does not change other draws.
        """
        values: dict[str, Value] = {}
        for i, (name, default) in enumerate(DEFAULTS.items()):
            written = list(default) if isinstance(default, tuple) else default
            spread = self.spreads.get(name) or spread_of(name, written)
            values[name] = spread.draw(np.random.default_rng([self.seed, number, i]))
        return values

    def identity(self, survey_id: str) -> str:
        """Return a hash that identifies this campaign of a survey, whatever the number of missions
        or the claim that stops it.
        """
        boats = {name: vars(boat) for name, boat in sorted(self.boats.items())}
        told: dict[str, Any] = {
            "survey": survey_id,
            "seed": self.seed,
            "success": vars(self.success),
            "spreads": {name: repr(self.spreads[name]) for name in sorted(self.spreads)},
            "boats": boats,
        }
        return hashlib.sha256(json.dumps(told, default=repr).encode()).hexdigest()


def _check(name: str, spread: Spread) -> None:
    values = spread.support()
    if name in WORDS:
        if not all(isinstance(value, str) for value in values) or not isinstance(spread, OneOf):
            raise UsageError(f"{name} is chosen by name; give one, or {{choose = [...]}}.")
        return
    numbers = [value for value in values if not isinstance(value, str)]
    if len(numbers) < len(values):
        raise UsageError(f"{name} is a number; give one, or a spread of numbers.")
    if name not in SIGNED and min(numbers) < 0:
        raise UsageError(f"{name} cannot be negative; give a spread with low = 0 or more.")
    if name in SHARES and max(numbers) > 1:
        raise UsageError(f"{name} is a share; give a spread within 0 to 1.")
    if name in BELOW_ONE and 1 <= max(numbers) < math.inf:
        raise UsageError(f"{name} is a share below 1; give a spread within 0 to 1, 1 left out.")
    if name in MOST and MOST[name] < max(numbers) < math.inf:
        raise UsageError(
            f"{name} reaches {max(numbers):g}, which is too large; give at most {MOST[name]:g}."
        )
