"""What a mission is run with."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.mission.measuring.sampling import EVERY_SECOND, Sampling
from grebe.mission.safety.settings import CAREFUL, SafetySettings


@dataclass(frozen=True, kw_only=True)
class MissionSettings:
    """`sampling`: which readings are kept. `limit_s`: the boat's time after which the mission
    ends whatever is left. `observes`: whether current and wind are estimated on the way.
    `safety`: what the boat's safety is judged by.
    """

    sampling: Sampling = EVERY_SECOND
    limit_s: float = math.inf
    observes: bool = True
    safety: SafetySettings = CAREFUL
