"""Plan the rest anew while the boat sails: when, beside the loop, and what comes of it.

The work is done in a thread of its own, and the boat goes on with its old order meanwhile; what it
reaches in that time makes the new order stale, and it is asked for again from there. A simulated
boat waits for its new order, for its time is not the clock's.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import GrebeError, PlanError
from grebe.core.revision import PlanRevision, Reason, Sortie, survey_of
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.mission.helm import Helm
from grebe.planning.region import water_of
from grebe.planning.revise import Halfway, OpenWater, open_water, replanned

# A current that differs by so much from the one that was planned with, for so long, is another.
OTHER_WEATHER_MPS, FOR_S = 0.15, 60.0


@dataclass(frozen=True, kw_only=True)
class NewOrder:
    """A revision, what of it the mission has to do, who steers it, and what it was made from."""

    revision: PlanRevision
    survey: Survey
    helm: Helm
    reached: int


# Where a mission goes on that has sailed its order, by the revision that it sails, how far it has
# come and its time [s]; `PlanError` says why it does not.
Extension = Callable[[PlanRevision, Halfway, float], PlanRevision]


@dataclass(kw_only=True)
class Replanner:
    """Keeps a mission's plan and makes revisions of it; `survey` is the whole of it, `helm_of`
    makes who steers a part. `waits` where the loop waits for a new order. `heeds`: targets out of
    reach and another weather are causes of a new order; `extends` says where the mission goes on
    once its order is sailed, and `over` why it does not.
    """

    survey: Survey
    revision: PlanRevision
    vessel: Vessel
    helm_of: Callable[[Survey], Helm]
    sortie: Sortie | None = None
    waits: bool = False
    heeds: bool = True
    extends: Extension | None = None
    over: str = ""
    _open: OpenWater | None = None
    _left_out: set[int] = field(default_factory=set[int])
    _thread: threading.Thread | None = None
    _new: NewOrder | Exception | None = None
    _since_s: float | None = None
    _weather: Weather | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a new order has been asked for and is not taken yet."""
        return self._thread is not None or self._new is not None

    def give_up(self, seq: int, reached: int, place: tuple[float, float], weather: Weather) -> None:
        """Ask for an order without a target that is not reached in time."""
        if self.is_busy or not self.heeds:
            return
        self._left_out.add(seq)
        note = f"target {seq} was not reached in time and is left out"
        self._ask("unreachable", note, reached, place, weather)

    def watch(
        self, time_s: float, reached: int, place: tuple[float, float], weather: Weather
    ) -> None:
        """Ask for an order for the weather where it has long been another than was planned with."""
        if not self.heeds:
            return
        planned = self._weather or (self.survey.settings.weather if self.survey.settings else CALM)
        north = weather.current_north_mps - planned.current_north_mps
        east = weather.current_east_mps - planned.current_east_mps
        if math.hypot(north, east) < OTHER_WEATHER_MPS:
            self._since_s = None
            return
        self._since_s = time_s if self._since_s is None else self._since_s
        if time_s - self._since_s < FOR_S or self.is_busy:
            return
        self._weather, self._since_s = weather, None
        note = (
            f"the current is {weather.current_north_mps:+.2f} m/s north, "
            f"{weather.current_east_mps:+.2f} m/s east, and was planned as "
            f"{planned.current_north_mps:+.2f}, {planned.current_east_mps:+.2f}"
        )
        self._ask("weather", note, reached, place, weather)

    def goes_on(self, time_s: float, reached: int, place: tuple[float, float]) -> bool:
        """Whether the mission goes on after its last target; where it does is asked for, once."""
        if self.extends is None or self.over:
            return False
        if not self.is_busy:
            self._start(self._extend, Halfway(reached=reached, place=place), time_s)
        return True

    def ready(self, reached: int, place: tuple[float, float], weather: Weather) -> NewOrder | None:
        """Return the new order once it is there; one that has become stale is asked for anew.

        Where there is none, `PlanError` says why, once.
        """
        if self._thread is not None and (self.waits or not self._thread.is_alive()):
            self._thread.join()
            self._thread = None
        if self._thread is not None or self._new is None:
            return None
        new, self._new = self._new, None
        if isinstance(new, PlanError):
            raise new
        if isinstance(new, Exception):
            raise PlanError(f"Planning anew failed ({type(new).__name__}: {new}).") from new
        if reached != new.reached:
            self._ask(new.revision.reason, new.revision.note, reached, place, weather)
            return None
        self.revision = new.revision
        if self.sortie is not None:
            self.sortie = new.revision.sortie(self.sortie.number)
        return new

    def _ask(
        self, reason: Reason, note: str, reached: int, place: tuple[float, float], weather: Weather
    ) -> None:
        halfway = Halfway(reached=reached, place=place, sortie=self.sortie)
        self._start(self._planned, reason, note, halfway, weather)

    def _start(self, work: Callable[..., NewOrder | None], *told: Any) -> None:
        def watched() -> None:
            try:
                self._new = work(*told)
            # The loop hears of whatever goes wrong: after a thread's silent death it would wait.
            except Exception as error:
                self._new = error

        self._thread = threading.Thread(target=watched, daemon=True)
        self._thread.start()

    def _extend(self, halfway: Halfway, time_s: float) -> NewOrder | None:
        assert self.extends is not None
        try:
            new = self.extends(self.revision, halfway, time_s)
        # What was to be surveyed is: no more is an end like any other.
        except GrebeError as error:
            self.over = str(error)
            return None
        return self._ordered(new, halfway)

    def _planned(self, reason: Reason, note: str, halfway: Halfway, weather: Weather) -> NewOrder:
        new = replanned(
            self.revision,
            self.survey,
            self._water(),
            halfway,
            vessel=self.vessel,
            weather=weather,
            reason=reason,
            note=note,
            without=self._left_out,
        )
        return self._ordered(new, halfway)

    def _ordered(self, new: PlanRevision, halfway: Halfway) -> NewOrder:
        part = None if self.sortie is None else new.sortie(self.sortie.number)
        survey = survey_of(self.survey, new, part)
        return NewOrder(
            revision=new, survey=survey, helm=self.helm_of(survey), reached=halfway.reached
        )

    def _water(self) -> OpenWater:
        """The cells and the ways between them, measured when they are first needed."""
        if self._open is None:
            self._open = open_water(self.survey, water_of(self.survey))
        return self._open
