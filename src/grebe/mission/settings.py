"""The settings of a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.mission.measuring.sampling import EVERY_SECOND, Sampling
from grebe.mission.safety.settings import CAREFUL, SafetySettings


@dataclass(frozen=True, kw_only=True)
class MissionSettings:
    """The settings of a mission.

    `sampling` selects the readings that are kept. `limit_s` is the boat's time [s] after which the
    mission ends, whatever is left. `observes` says whether current and wind are estimated during
    the mission. `safety` holds the settings by which the boat's safety is judged.
    """

    sampling: Sampling = EVERY_SECOND
    limit_s: float = math.inf
    observes: bool = True
    safety: SafetySettings = CAREFUL
