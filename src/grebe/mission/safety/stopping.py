"""Whether, and how, the boat could still stop inside its fence and away from other boats."""

from __future__ import annotations

import math

from grebe.control.station import StationKeeper
from grebe.core.dynamics import Weather
from grebe.core.events import Thrusts
from grebe.core.vessel import Vessel
from grebe.links.base import Observation
from grebe.mission.safety.fence import (
    FOLLOWED_DOUBT,
    FOLLOWED_S,
    STEP_S,
    Escape,
    Fence,
    Schedule,
    escape,
)
from grebe.mission.safety.lookout import Lookout
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Place

# A plan to stop that was found longer ago than this is for another place [s].
PROVED_S = 1.0


class Stopping:
    """Looks for plans to stop one boat, and remembers the last one that is permitted.

    `by_motion`: an autopilot holds the boat's motion, and how it does so is not known exactly.
    """

    def __init__(
        self,
        vessel: Vessel,
        settings: SafetySettings,
        lookout: Lookout | None,
        *,
        by_motion: bool,
    ) -> None:
        self.vessel = vessel
        self._settings, self._lookout, self._by_motion = settings, lookout, by_motion
        self._last_plan: tuple[float, Escape] | None = None

    @property
    def keeper(self) -> StationKeeper:
        """The law that brakes the boat and keeps its position."""
        share = self._settings.weaker_share
        return StationKeeper(vessel=self.vessel, weaker_share=share, by_motion=self._by_motion)

    @property
    def _reaction_s(self) -> float:
        """The time until the boat follows a command, besides the lags of its model [s]."""
        return self._settings.reaction_s + (FOLLOWED_S if self._by_motion else 0.0)

    def can_stop(
        self, fence: Fence, observation: Observation, ahead: Schedule, weather: Weather
    ) -> bool:
        """Whether the boat, with the thrusts `ahead` until the next estimate, could still stop
        inside and away from others. If so, the plan to stop is remembered.
        """
        place, lookout = (observation.state[0], observation.state[1]), self._lookout
        near = lookout is not None and lookout.is_near(place)
        within = lookout.fence(fence, place) if lookout and near else fence
        escape_plan = self.escape_plan(within, observation, ahead, weather, foresees=near)
        if escape_plan is None or (lookout and not lookout.claim(escape_plan.path)):
            return False
        self._last_plan = (observation.time_s, escape_plan)
        return True

    def escape_plan(
        self,
        fence: Fence,
        observation: Observation,
        ahead: Schedule,
        weather: Weather,
        *,
        foresees: bool = False,
    ) -> Escape | None:
        """Return how the boat would stop inside a fence; None if it would not."""
        return escape(
            fence,
            self.keeper,
            observation.state,
            ahead,
            weather,
            reaction_s=self._reaction_s + observation.age_s,
            doubt=FOLLOWED_DOUBT if self._by_motion else 0.0,
            foresees=foresees,
        )

    def refuge(self, time_s: float) -> Place | None:
        """Return the refuge of the last plan to stop, while it is recent. A new refuge would differ
        by the distance covered since, and take a heavy boat along another path.
        """
        since, escape_plan = self._last_plan or (-math.inf, None)
        return escape_plan.refuge if escape_plan and time_s - since < PROVED_S else None

    def thrusts(self, time_s: float) -> Thrusts | None:
        """Return the present thrusts of the last plan to stop, while it still follows a plan."""
        if self._last_plan is None:
            return None
        since, escape_plan = self._last_plan
        step = round((time_s - since) / STEP_S)
        reaction = math.ceil(self._reaction_s / STEP_S)
        planned = len(escape_plan.thrusts) > reaction + 1
        return escape_plan.thrusts[step] if planned and step < len(escape_plan.thrusts) else None
