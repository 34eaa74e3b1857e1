"""How much slower a sortie is than predicted, and whether enough time is left for the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.core.dynamics import CALM
from grebe.core.plan_settings import SortieSettings
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Place
from grebe.planning.revisions.postpone import Delay
from grebe.planning.revisions.revise import remaining_s
from grebe.planning.trips.endurance import MARGIN

# The pace is judged first after `LEAST_S`, then every `EVERY_S` [s]; a ratio of flown to expected
# time below `SLOW` is chance.
LEAST_S, EVERY_S = 180.0, 60.0
SLOW = 1.05


@dataclass(kw_only=True)
class Pace:
    """Compares one mission with its prediction, from the first estimate on.

    `spent_s` is the time [s] for which the boat had been under way since its harbour, before this
    mission. The battery is assumed to last as long as it does at the power drawn so far: a boat
    that is slow in order to save its battery has not used it up.
    """

    vessel: Vessel
    bounds: SortieSettings
    spent_s: float = 0.0
    _began: tuple[float, Place, int, float] | None = None
    _next_s: float = -math.inf

    def delay(
        self, time_s: float, reached: int, place: Place, part: Survey, used_wh: float
    ) -> Delay | None:
        """Return how late the sortie is if its rest no longer fits; None if it fits or is not
        judged now.

        `part` is the sortie's own survey; `used_wh` is the energy used since the harbour [Wh].
        """
        if self._began is None:
            self._began = (time_s, place, reached, used_wh)
        began_s, start, before, used_before_wh = self._began
        elapsed_s = time_s - began_s
        if time_s < self._next_s or elapsed_s < LEAST_S or reached == before:
            return None
        self._next_s = time_s + EVERY_S
        weather = part.settings.weather if part.settings else CALM
        expected_s = remaining_s(part, start, part.targets[before:reached], weather, self.vessel)
        rest_s = remaining_s(part, place, part.targets[reached:], weather, self.vessel)
        pace = elapsed_s / max(expected_s, 1e-9)
        left_s = self._left_s(elapsed_s, used_wh, (used_wh - used_before_wh) / elapsed_s)
        if pace < SLOW or MARGIN * pace * rest_s <= left_s:
            return None
        return Delay(pace=pace, elapsed_s=elapsed_s, left_s=left_s)

    def _left_s(self, elapsed_s: float, used_wh: float, wh_per_s: float) -> float:
        """Return how long the boat may still be out [s], by its minutes and by its battery at this
        power.
        """
        bounds, most = self.bounds, 1 - self.bounds.reserve
        left_s = [math.inf]
        if bounds.minutes is not None:
            left_s.append(most * 60 * bounds.minutes - self.spent_s - elapsed_s)
        if bounds.battery_wh is not None and wh_per_s > 0:
            left_s.append((most * bounds.battery_wh - used_wh) / wh_per_s)
        return min(left_s)
