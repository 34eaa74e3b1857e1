"""A survey in sorties, as a run sees it: how far each sortie has come, and when it must be home."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from grebe.core.revision import Sortie
from grebe.core.survey import Survey
from grebe.io.store import SurveyFile
from grebe.mission.consumption import NOTHING, Consumption
from grebe.mission.safety.settings import SafetySettings


@dataclass(frozen=True, kw_only=True)
class SortieState:
    """A sortie, and how many of its targets are reached."""

    sortie: Sortie
    reached: int

    @property
    def is_flown(self) -> bool:
        """Whether all of its targets are reached."""
        return self.reached == len(self.sortie)

    def __str__(self) -> str:
        one = self.sortie
        return (
            f"{one.number}: {self.reached} of {len(one)} targets, {one.time_s / 60:.0f} min, "
            f"{one.energy_wh:.0f} Wh"
        )


def sortie_states(survey_file: SurveyFile) -> list[SortieState]:
    """Return how far each sortie of the plan has come; empty if it has none."""
    progress = survey_file.progress()
    return [
        SortieState(sortie=one, reached=progress.reached_in(one))
        for one in survey_file.revision.sorties
    ]


def kept_by_plan(
    safety: SafetySettings, survey: Survey, spent: Consumption = NOTHING
) -> SafetySettings:
    """Return the settings with the battery and the time that the plan's sorties are made for.

    The time `spent` since the harbour is subtracted. Values that the run states are kept. `survey`
    is that of the sortie, with the battery of its own boat.
    """
    bounds = None if survey.settings is None else survey.settings.sorties
    if bounds is None:
        return safety
    if safety.battery_wh is None and bounds.battery_wh is not None:
        safety = replace(safety, battery_wh=bounds.battery_wh, battery_reserve=bounds.reserve)
    if math.isinf(safety.max_s) and bounds.minutes is not None:
        left_s = 60 * bounds.minutes * (1 - bounds.reserve) - spent.seconds
        safety = replace(safety, max_s=max(left_s, 1.0))
    return safety
