"""Replan the remaining targets in the background while the boat sails.

Planning runs in its own thread, and the boat continues with its old order meanwhile. If it reaches
a target in that time, the new order is stale, and another is requested from there. A simulated boat
waits for its new order, because its time is not the clock's.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.counts import counted
from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import GrebeError, PlanError
from grebe.core.revision import PlanRevision, Reason, Sortie, left_out, survey_of
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.mission.helm import Helm
from grebe.mission.pace import Pace
from grebe.mission.safety.states import Place
from grebe.planning.region import water_of
from grebe.planning.revisions.connect import OFF_CORRIDOR_M, connected, is_connected
from grebe.planning.revisions.postpone import Delay, postponed
from grebe.planning.revisions.revise import Halfway, OpenWater, open_water, replanned

# A new order is needed once the current differs from the planned one by this much [m/s] for this
# long [s].
OTHER_WEATHER_MPS, FOR_S = 0.15, 60.0
# How often a boat that cannot get to its next place of an extension looks for another [s].
AGAIN_S = 30.0


@dataclass(frozen=True, kw_only=True)
class NewOrder:
    """A revision, the mission's part of it as a survey, and the helm that steers it; also the
    number of targets `reached` from which it was made, and the `note` of its request.
    """

    revision: PlanRevision
    survey: Survey
    helm: Helm
    reached: int
    note: str


# Returns how a mission continues after its last target, given its current revision, its progress
# and its time [s]. Raises `PlanError`, with the reason, if it does not.
Extension = Callable[[PlanRevision, Halfway, float], PlanRevision]


@dataclass(kw_only=True)
class SharedPlan:
    """The plan of a survey, which the boats of a fleet share; each boat reorders its own part.

    `closed` are the areas that have been closed to all boats. `keep` stores a revision that is
    taken, if the mission's recorder alone would not keep revisions in their order.
    """

    revision: PlanRevision
    keep: Callable[[PlanRevision], None] | None = None
    closed: tuple[shapely.Polygon, ...] = ()
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def close(self, zones: Sequence[shapely.Polygon]) -> None:
        """Remember closed areas, each once: every boat of a fleet receives the same ones."""
        with self._lock:
            new = [zone for zone in zones if not any(zone.equals(one) for one in self.closed)]
            self.closed = (*self.closed, *new)

    def take(self, new: PlanRevision) -> bool:
        """Make a revision the plan; return False if another boat's revision has come first."""
        with self._lock:
            if new.number != self.revision.number + 1:
                return False
            if self.keep is not None:
                self.keep(new)
            self.revision = new
            return True


@dataclass(kw_only=True)
class Replanner:
    """Makes revisions of a mission's plan.

    `survey` is the complete survey, `sortie` the number of the part that is sailed, and `helm_of`
    makes the helm for a part. `waits` says whether the loop waits for a new order. `reacts` says
    whether unreachable targets and changed weather cause a new order. `extends` returns how the
    mission continues after its last target; `why_over` says why it does not. `asked` is the reason
    of the last request, and `why_kept` says why the old order could not be replaced. `spent_s` is
    the time for which the boat had been under way since its harbour, before this mission [s].
    """

    survey: Survey
    plan: SharedPlan
    vessel: Vessel
    helm_of: Callable[[Survey], Helm]
    sortie: int | None = None
    waits: bool = False
    reacts: bool = True
    extends: Extension | None = None
    why_over: str = ""
    why_kept: str = ""
    spent_s: float = 0.0
    asked: Reason | None = None
    _open: OpenWater | None = None
    _closures_known: int = 0
    _has_extended: bool = False
    _asked_again_s: float = -math.inf
    _free: tuple[int, BaseGeometry] | None = None
    _pace: Pace | None = None
    _delay: Delay | None = None
    _left_out: set[int] = field(default_factory=set[int])
    _thread: threading.Thread | None = None
    _new: NewOrder | Exception | None = None
    _since_s: float | None = None
    _weather: Weather | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a new order has been requested and not yet taken."""
        return self._thread is not None or self._new is not None

    def give_up(self, seq: int, reached: int, place: Place, weather: Weather) -> None:
        """Request an order without the target `seq`, which is not reached in time."""
        if self.is_busy or not self.reacts:
            return
        self._left_out.add(seq)
        note = f"target {seq} was not reached in time and is left out"
        self._ask("unreachable", note, reached, place, weather)

    def watch(
        self, time_s: float, reached: int, place: Place, weather: Weather, used_wh: float
    ) -> None:
        """Request an order for the present weather if that has long differed from the planned one,
        and a shorter sortie if the present one takes too long or too much of the battery.

        `used_wh` is the energy used since the harbour [Wh].
        """
        if not self.reacts:
            return
        self._watch_pace(time_s, reached, place, weather, used_wh)
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
        if all(one.kind == "transit" for one in self._part.targets[reached:]):
            return
        note = (
            f"the current is {weather.current_north_mps:+.2f} m/s north, "
            f"{weather.current_east_mps:+.2f} m/s east; the plan assumed "
            f"{planned.current_north_mps:+.2f}, {planned.current_east_mps:+.2f}"
        )
        self._ask("weather", note, reached, place, weather)

    def connect(self, reached: int, place: Place, weather: Weather) -> None:
        """Request a route to the next target if the boat cannot sail straight to it."""
        if not self.is_busy and not is_connected(self._part, self._sailable, reached, place):
            self._ask("resumed", "", reached, place, weather)

    @property
    def is_connecting(self) -> bool:
        """Whether the boat has to wait for a route to its next target."""
        return self.is_busy and self.asked == "resumed"

    def _watch_pace(
        self, time_s: float, reached: int, place: Place, weather: Weather, used_wh: float
    ) -> None:
        """Request a shorter sortie if the present one is too slow to be back in time."""
        settings, sortie = self.survey.settings, self._sortie_in(self.plan.revision)
        if self.is_busy or settings is None or settings.sorties is None or sortie is None:
            return
        self._pace = self._pace or Pace(
            vessel=self.vessel,
            bounds=settings.sorties.of_boat(sortie.boat),
            spent_s=self.spent_s,
        )
        self._delay = self._pace.delay(time_s, reached, place, self._part, used_wh)
        if self._delay is not None:
            self._ask("progress", "", reached, place, weather)

    def close(
        self, zones: Sequence[shapely.Polygon], reached: int, place: Place, weather: Weather
    ) -> None:
        """Request an order that keeps out of `zones`, if the boat or its remaining route is in
        them. An order that is being made meanwhile is not taken.
        """
        self.plan.close(zones)
        if not self.is_busy:
            self._ask_around_closed(reached, place, weather)

    def _ask_around_closed(self, reached: int, place: Place, weather: Weather) -> bool:
        """Request an order that keeps out of the closed areas, if the present one does not; return
        whether one was requested.
        """
        closed = self.plan.closed
        self._closures_known = len(closed)
        if not _goes_through(closed, self._part, reached, place):
            return False
        taken = shapely.intersection(self.survey.water, shapely.union_all(list(closed)))
        self._ask("closed", f"{taken.area:,.0f} m2 are closed", reached, place, weather)
        return True

    def asks_for_another_place(self, time_s: float, reached: int, place: Place) -> bool:
        """Whether an extended mission, which cannot get to its next place, has requested another.
        Requests one if it is due.
        """
        if not (self._has_extended and self.may_extend):
            return False
        if not self.is_busy and time_s - self._asked_again_s >= AGAIN_S:
            self.asked, self._asked_again_s = None, time_s
            self._start(self._extend, reached, place, time_s)
        return self.is_busy

    @property
    def may_extend(self) -> bool:
        """Whether the mission may continue after its last target, as far as is known."""
        return self.extends is not None and not self.why_over

    def asks_to_extend(self, time_s: float, reached: int, place: Place) -> bool:
        """Whether the mission continues after its last target; if so, request where, once."""
        if not self.may_extend:
            return False
        if not self.is_busy:
            self.asked = None
            self._start(self._extend, reached, place, time_s)
        return True

    def ready(self, reached: int, place: Place, weather: Weather) -> NewOrder | None:
        """Return the new order once it is ready; request another if it has become stale.

        Raises `PlanError`, once, if closed areas or an unreachable target leave no order. If
        planning fails after any other cause, the order stays as it is, and `why_kept` says why.
        """
        if self._thread is not None and (self.waits or not self._thread.is_alive()):
            self._thread.join()
            self._thread = None
        if self._thread is not None:
            return None
        new, self._new = self._new, None
        is_behind = self._closures_known != len(self.plan.closed)
        if is_behind and self._ask_around_closed(reached, place, weather):
            return None
        if isinstance(new, Exception):
            self._failed(new)
            return None
        if new is not None and (reached != new.reached or not self.plan.take(new.revision)):
            # The loop itself repeats its request for an extension.
            if new.revision.reason == "adaptive":
                return None
            self._ask(new.revision.reason, new.note, reached, place, weather)
            return None
        if new is not None and new.revision.reason == "adaptive":
            self._has_extended = True
        return new

    def _failed(self, error: Exception) -> None:
        named = isinstance(error, PlanError)
        why = str(error) if named else f"{type(error).__name__}: {error}"
        if self.asked in ("closed", "unreachable"):
            raise PlanError(why if named else f"Replanning failed ({why}).") from error
        # A sortie that fits after all, or cannot be shortened, needs no message: the guard calls
        # the boat home in time.
        if self.asked != "progress" or not named:
            self.why_kept = f"the order stays as it is, because no other was found ({why})"

    def _ask(self, reason: Reason, note: str, reached: int, place: Place, weather: Weather) -> None:
        self.asked = reason
        old = self.plan.revision
        halfway = Halfway(reached=reached, place=place, sortie=self._sortie_in(old))
        self._start(self._planned, old, reason, note, halfway, weather)

    def _sortie_in(self, plan: PlanRevision) -> Sortie | None:
        return None if self.sortie is None else plan.sortie(self.sortie)

    @property
    def _part(self) -> Survey:
        """The mission's part of the present plan."""
        plan = self.plan.revision
        return survey_of(self.survey, plan, self._sortie_in(plan))

    def _start(self, work: Callable[..., NewOrder | None], *arguments: Any) -> None:
        def watched() -> None:
            try:
                self._new = work(*arguments)
            # Every error is passed to the loop, which would wait for ever if the thread just died.
            except Exception as error:
                self._new = error

        self._thread = threading.Thread(target=watched, daemon=True)
        self._thread.start()

    def _extend(self, reached: int, place: Place, time_s: float) -> NewOrder | None:
        assert self.extends is not None
        old = self.plan.revision
        halfway = Halfway(reached=reached, place=place, sortie=self._sortie_in(old))
        try:
            new = self.extends(old, halfway, time_s)
        # The survey itself is complete, so an extension that cannot be planned is a normal end.
        except GrebeError as error:
            self.why_over = str(error)
            return None
        # A second request would fail too, and the boat would wait.
        except Exception as error:
            self.why_over = f"the extension could not be planned ({type(error).__name__}: {error})"
            return None
        part = survey_of(self.survey, new, self._sortie_in(new))
        if _goes_through(self.plan.closed, part, reached, None):
            self.why_over = "the route to the most useful places leads through a closed area"
            return None
        return self._ordered(new, halfway)

    def _planned(
        self, old: PlanRevision, reason: Reason, note: str, halfway: Halfway, weather: Weather
    ) -> NewOrder:
        water = self._water(halfway.place)
        if reason == "resumed":
            return self._ordered(connected(old, self.survey, water, halfway), halfway, note)
        if reason == "progress" and self._delay is not None:
            # The pace is relative to the prediction for the planned weather.
            planned = self.survey.settings.weather if self.survey.settings else weather
            new = postponed(
                old, self.survey, water, halfway, self._delay, vessel=self.vessel, weather=planned
            )
            return self._ordered(new, halfway, note)
        new = replanned(
            old,
            self.survey,
            water,
            halfway,
            vessel=self.vessel,
            weather=weather,
            reason=reason,
            note=note,
            without=self._left_out,
        )
        if reason == "closed":
            lost = counted(len(left_out(old, new)), "target is", "targets are")
            new = replace(new, note=f"{note}; {lost} left out")
        return self._ordered(new, halfway, note)

    def _ordered(self, new: PlanRevision, halfway: Halfway, note: str = "") -> NewOrder:
        survey = survey_of(self.survey, new, self._sortie_in(new))
        helm = self.helm_of(survey)
        return NewOrder(revision=new, survey=survey, helm=helm, reached=halfway.reached, note=note)

    def _water(self, place: Place) -> OpenWater:
        """The cells and the routes between them, computed when they are first needed."""
        if self._open is None:
            self._open = open_water(self.survey, water_of(self.survey))
        if not self.plan.closed:
            return self._open
        margin_m = self.survey.settings.shore_margin_m if self.survey.settings else 0.0
        zones = [zone.buffer(margin_m, quad_segs=4) for zone in self.plan.closed]
        return self._open.closing(zones, place)

    def _sailable(self) -> BaseGeometry:
        """The water in which the boat may be; unlike the plan, it has no shore margin."""
        taken = (*self.survey.no_go, *self.plan.closed)
        if self._free is None or self._free[0] != len(taken):
            left = shapely.difference(self.survey.water, shapely.union_all(list(taken)))
            self._free = (len(taken), left.buffer(OFF_CORRIDOR_M))
            shapely.prepare(self._free[1])
        return self._free[1]


def _goes_through(
    zones: Sequence[shapely.Polygon], part: Survey, reached: int, place: Place | None
) -> bool:
    """Whether the remaining targets and corridors of a boat, or its place, touch any zone."""
    if not zones:
        return False
    closed = shapely.union_all(list(zones))
    shapely.prepare(closed)
    shapes = [*(one.set.polygon for one in part.targets[reached:]), *part.corridors[reached:]]
    here = [] if place is None else [shapely.Point(place)]
    return bool(shapely.intersects(np.array([*shapes, *here], dtype=object), closed).any())
