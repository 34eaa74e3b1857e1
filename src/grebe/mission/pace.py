"""How much slower a sortie goes than it was predicted, and whether it still has the time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.core.dynamics import CALM
from grebe.core.plan_settings import SortieSettings
from grebe.core.revision import Sortie
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Place
from grebe.planning.endurance import MARGIN
from grebe.planning.put_off import Late
from grebe.planning.revise import remaining_s

# A pace is judged once so much was flown, and again so often [s]; less than the share is chance.
LEAST_S, EVERY_S = 180.0, 60.0
SLOW = 1.05


def limit_s(bounds: SortieSettings, sortie: Sortie) -> float:
    """When a sortie must be back [s], by its time or by its battery at the predicted power."""
    limits = [math.inf if bounds.minutes is None else 60 * bounds.minutes]
    if bounds.battery_wh is not None and sortie.energy_wh > 0:
        limits.append(bounds.battery_wh / sortie.energy_wh * sortie.time_s)
    return (1 - bounds.reserve) * min(limits)


@dataclass(kw_only=True)
class Pace:
    """Compares one mission with what was predicted of it, from the first estimate on; `spent_s` is
    what its boat had been under way before, since its harbour.
    """

    vessel: Vessel
    bounds: SortieSettings
    spent_s: float = 0.0
    _began: tuple[float, Place, int] | None = None
    _next_s: float = -math.inf

    def late(
        self, time_s: float, reached: int, place: Place, part: Survey, sortie: Sortie
    ) -> Late | None:
        """Return by how much a sortie is late where its rest does not fit; None where it does.

        `part` is the sortie's own survey.
        """
        if self._began is None:
            self._began = (time_s, place, reached)
        began_s, start, before = self._began
        flown_s = time_s - began_s
        if time_s < self._next_s or flown_s < LEAST_S or reached == before:
            return None
        self._next_s = time_s + EVERY_S
        weather = part.settings.weather if part.settings else CALM
        expected_s = remaining_s(part, start, part.targets[before:reached], weather, self.vessel)
        rest_s = remaining_s(part, place, part.targets[reached:], weather, self.vessel)
        pace = flown_s / max(expected_s, 1e-9)
        left_s = limit_s(self.bounds, sortie) - self.spent_s - flown_s
        if pace < SLOW or MARGIN * pace * rest_s <= left_s:
            return None
        return Late(pace=pace, flown_s=flown_s, left_s=left_s)
