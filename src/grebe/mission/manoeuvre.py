"""A manoeuvre, run through the mission loop: the helm is a programme, and no target is reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grebe.control.controller import Command, StepStatus
from grebe.core.dynamics import Weather
from grebe.core.events import MissionEvent, State, Step
from grebe.core.sets import rectangle
from grebe.core.survey import Survey, Target
from grebe.core.vessel import Vessel
from grebe.identification.manoeuvre import Manoeuvre
from grebe.links.base import BoatLink
from grebe.mission.events.recorders import Listener, MemoryRecorder
from grebe.mission.loop import Mission, MissionSettings
from grebe.mission.measuring.sampling import InSets

STEP_S = 0.1
# The loop ends when a target is reached or given up. This target is too far away for either.
NOWHERE_NEAR_M = 1e5
# The passage to the circle and the manoeuvre together take less time than this [s].
LONGEST_S = 3600.0
OVER = "the manoeuvre is complete"


@dataclass(frozen=True, kw_only=True)
class ManoeuvreEnd:
    """How a manoeuvre ended: whether it is `complete`, and the loop's `message`."""

    complete: bool
    message: str


class ManoeuvreHelm:
    """A `Helm` that follows a manoeuvre."""

    def __init__(self, manoeuvre: Manoeuvre) -> None:
        self.reached = 0
        self._manoeuvre = manoeuvre
        self._now_s = 0.0

    @property
    def vessel(self) -> Vessel:
        """See `Helm`."""
        return self._manoeuvre.vessel

    @property
    def step_s(self) -> float:
        """See `Helm`."""
        return STEP_S

    def step(self, state: State, weather: Weather, elapsed_s: float | None) -> Command:  # noqa: ARG002
        """See `Helm`."""
        self._now_s += elapsed_s or 0.0
        thrusts = self._manoeuvre.thrusts(self._now_s, state)
        return Command(thrusts=thrusts, plan=None, status=StepStatus.SOLVED, target=0, split=0)


def sail_manoeuvre(
    survey: Survey, manoeuvre: Manoeuvre, link: BoatLink, listeners: Sequence[Listener] = ()
) -> ManoeuvreEnd:
    """Drive a manoeuvre in a survey's water, and leave the boat without thrust. `listeners` receive
    the mission's events.
    """
    north, east = manoeuvre.circle.north_m + NOWHERE_NEAR_M, manoeuvre.circle.east_m
    away = rectangle((north, north + 1.0), (east, east + 1.0), (0.0, 1.0))
    target = Target(seq=1, kind="transit", set=away)
    mission = Mission(
        replace(survey, targets=(target,), corridors=(), vessel=manoeuvre.vessel),
        ManoeuvreHelm(manoeuvre),
        link,
        MemoryRecorder(),
        MissionSettings(sampling=InSets(), limit_s=LONGEST_S, observes=False),
        listeners=[*listeners, lambda event: _end(mission, manoeuvre, event)],
    )
    report = mission.run()
    return ManoeuvreEnd(complete=report.message == OVER, message=report.message)


def _end(mission: Mission, manoeuvre: Manoeuvre, event: MissionEvent) -> None:
    if isinstance(event, Step) and manoeuvre.is_over:
        mission.stop(OVER)
