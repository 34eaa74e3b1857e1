"""Plan the rest anew while the boat sails: when, beside the loop, and what comes of it.

The work is done in a thread of its own, and the boat goes on with its old order meanwhile; what it
reaches in that time makes the new order stale, and it is asked for again from there. A simulated
boat waits for its new order, for its time is not the clock's.
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
from grebe.planning.revisions.lead_on import ASTRAY_M, is_led, led_on
from grebe.planning.revisions.put_off import Late, put_off
from grebe.planning.revisions.revise import Halfway, OpenWater, open_water, replanned

# A current that differs by so much from the one that was planned with, for so long, is another.
OTHER_WEATHER_MPS, FOR_S = 0.15, 60.0
# A boat that cannot come to where it would pay looks for another place so often [s].
AGAIN_S = 30.0


@dataclass(frozen=True, kw_only=True)
class NewOrder:
    """A revision, what of it the mission has to do, who steers it, and what it was made from: so
    many targets reached, and the `note` that it was asked for with.
    """

    revision: PlanRevision
    survey: Survey
    helm: Helm
    reached: int
    note: str


# Where a mission goes on that has sailed its order, by the revision that it sails, how far it has
# come and its time [s]; `PlanError` says why it does not.
Extension = Callable[[PlanRevision, Halfway, float], PlanRevision]


@dataclass(kw_only=True)
class KeptPlan:
    """The plan of a survey, which the boats of a fleet share: each puts its own part in another
    order. `closed` are the areas that have been closed to all. `keep` writes down a revision that
    is taken, where the mission's recorder alone would not keep them in their order.
    """

    revision: PlanRevision
    keep: Callable[[PlanRevision], None] | None = None
    closed: tuple[shapely.Polygon, ...] = ()
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def close(self, zones: Sequence[shapely.Polygon]) -> None:
        """Keep in mind what is closed; of a fleet each boat hears of the same areas."""
        with self._lock:
            new = [zone for zone in zones if not any(zone.equals(one) for one in self.closed)]
            self.closed = (*self.closed, *new)

    def take(self, new: PlanRevision) -> bool:
        """Take a revision for the plan; False where another boat's has come in between."""
        with self._lock:
            if new.number != self.revision.number + 1:
                return False
            if self.keep is not None:
                self.keep(new)
            self.revision = new
            return True


@dataclass(kw_only=True)
class Replanner:
    """Makes revisions of a mission's plan; `survey` is the whole of it, `sortie` the number of the
    part that is sailed, `helm_of` makes who steers a part. `waits` where the loop waits for a new
    order. `heeds`: targets out of reach and another weather are causes of a new order; `extends`
    says where the mission goes on once its order is sailed, and `over` why it does not. `asked`:
    what an order was last asked for; `kept`: why the old one stays that was to be replaced.
    `spent_s`: time that the boat had been under way since its harbour, before this mission [s].
    """

    survey: Survey
    plan: KeptPlan
    vessel: Vessel
    helm_of: Callable[[Survey], Helm]
    sortie: int | None = None
    waits: bool = False
    heeds: bool = True
    extends: Extension | None = None
    over: str = ""
    kept: str = ""
    spent_s: float = 0.0
    asked: Reason | None = None
    _open: OpenWater | None = None
    _heeded: int = 0
    _went_on: bool = False
    _turned_s: float = -math.inf
    _free: tuple[int, BaseGeometry] | None = None
    _pace: Pace | None = None
    _late: Late | None = None
    _left_out: set[int] = field(default_factory=set[int])
    _thread: threading.Thread | None = None
    _new: NewOrder | Exception | None = None
    _since_s: float | None = None
    _weather: Weather | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a new order has been asked for and is not taken yet."""
        return self._thread is not None or self._new is not None

    def give_up(self, seq: int, reached: int, place: Place, weather: Weather) -> None:
        """Ask for an order without a target that is not reached in time."""
        if self.is_busy or not self.heeds:
            return
        self._left_out.add(seq)
        note = f"target {seq} was not reached in time and is left out"
        self._ask("unreachable", note, reached, place, weather)

    def watch(
        self, time_s: float, reached: int, place: Place, weather: Weather, used_wh: float
    ) -> None:
        """Ask for an order for the weather where it has long been another than was planned with,
        and for a shorter sortie where it takes too long, or too much of the battery: `used_wh`
        since the harbour.
        """
        if not self.heeds:
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
            f"{weather.current_east_mps:+.2f} m/s east, and was planned as "
            f"{planned.current_north_mps:+.2f}, {planned.current_east_mps:+.2f}"
        )
        self._ask("weather", note, reached, place, weather)

    def lead_on(self, reached: int, place: Place, weather: Weather) -> None:
        """Ask for a way to the next target where the boat cannot sail straight on to it."""
        if not self.is_busy and not is_led(self._part, self._sailable, reached, place):
            self._ask("resumed", "", reached, place, weather)

    @property
    def leads(self) -> bool:
        """Whether the boat has to wait for a way to its next target."""
        return self.is_busy and self.asked == "resumed"

    def _watch_pace(
        self, time_s: float, reached: int, place: Place, weather: Weather, used_wh: float
    ) -> None:
        """Ask for a shorter sortie where it goes too slowly to be back in time."""
        settings, sortie = self.survey.settings, self._sortie_in(self.plan.revision)
        if self.is_busy or settings is None or settings.sorties is None or sortie is None:
            return
        self._pace = self._pace or Pace(
            vessel=self.vessel,
            bounds=settings.sorties.of_boat(sortie.boat),
            spent_s=self.spent_s,
        )
        self._late = self._pace.late(time_s, reached, place, self._part, used_wh)
        if self._late is not None:
            self._ask("progress", "", reached, place, weather)

    def close(
        self, zones: Sequence[shapely.Polygon], reached: int, place: Place, weather: Weather
    ) -> None:
        """Ask for an order that keeps out of zones, where what is ahead of the boat does not; one
        that is being made meanwhile is not taken.
        """
        self.plan.close(zones)
        if not self.is_busy:
            self._heed_closed(reached, place, weather)

    def _heed_closed(self, reached: int, place: Place, weather: Weather) -> bool:
        """Ask for an order that keeps out of what is closed, if the one that is sailed does not."""
        closed = self.plan.closed
        self._heeded = len(closed)
        if not _goes_through(closed, self._part, reached, place):
            return False
        taken = shapely.intersection(self.survey.water, shapely.union_all(list(closed)))
        self._ask("closed", f"{taken.area:,.0f} m2 are closed", reached, place, weather)
        return True

    def goes_elsewhere(self, time_s: float, reached: int, place: Place) -> bool:
        """Whether the mission, which goes on where it pays, has asked for another place than its
        next, to which it does not come.
        """
        if not (self._went_on and self.may_go_on):
            return False
        if not self.is_busy and time_s - self._turned_s >= AGAIN_S:
            self.asked, self._turned_s = None, time_s
            self._start(self._extend, reached, place, time_s)
        return self.is_busy

    @property
    def may_go_on(self) -> bool:
        """Whether the mission may go on after its last target, as far as is known."""
        return self.extends is not None and not self.over

    def goes_on(self, time_s: float, reached: int, place: Place) -> bool:
        """Whether the mission goes on after its last target; where it does is asked for, once."""
        if not self.may_go_on:
            return False
        if not self.is_busy:
            self.asked = None
            self._start(self._extend, reached, place, time_s)
        return True

    def ready(self, reached: int, place: Place, weather: Weather) -> NewOrder | None:
        """Return the new order once it is there; one that has become stale is asked for anew.

        Where what is closed, or a target out of reach, leaves no order, `PlanError` says why, once;
        of other causes the order stays as it is, and `kept` says why.
        """
        if self._thread is not None and (self.waits or not self._thread.is_alive()):
            self._thread.join()
            self._thread = None
        if self._thread is not None:
            return None
        new, self._new = self._new, None
        unheeded = self._heeded != len(self.plan.closed)
        if unheeded and self._heed_closed(reached, place, weather):
            return None
        if isinstance(new, Exception):
            self._failed(new)
            return None
        if new is not None and (reached != new.reached or not self.plan.take(new.revision)):
            # Where the mission goes on is asked for again by the loop, as it was before.
            if new.revision.reason == "adaptive":
                return None
            self._ask(new.revision.reason, new.note, reached, place, weather)
            return None
        if new is not None and new.revision.reason == "adaptive":
            self._went_on = True
        return new

    def _failed(self, error: Exception) -> None:
        named = isinstance(error, PlanError)
        why = str(error) if named else f"{type(error).__name__}: {error}"
        if self.asked in ("closed", "unreachable"):
            raise PlanError(why if named else f"Planning anew failed ({why}).") from error
        # A sortie that fits after all, or cannot be shortened, is no news: the guard calls it home.
        if self.asked != "progress" or not named:
            self.kept = f"the order stays as it is, for no other was found ({why})"

    def _ask(self, reason: Reason, note: str, reached: int, place: Place, weather: Weather) -> None:
        self.asked = reason
        old = self.plan.revision
        halfway = Halfway(reached=reached, place=place, sortie=self._sortie_in(old))
        self._start(self._planned, old, reason, note, halfway, weather)

    def _sortie_in(self, plan: PlanRevision) -> Sortie | None:
        return None if self.sortie is None else plan.sortie(self.sortie)

    @property
    def _part(self) -> Survey:
        """What of the plan the mission sails, as it is now."""
        plan = self.plan.revision
        return survey_of(self.survey, plan, self._sortie_in(plan))

    def _start(self, work: Callable[..., NewOrder | None], *told: Any) -> None:
        def watched() -> None:
            try:
                self._new = work(*told)
            # The loop hears of whatever goes wrong: after a thread's silent death it would wait.
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
        # What was to be surveyed is: no more is an end like any other.
        except GrebeError as error:
            self.over = str(error)
            return None
        # Asked again it would fail again, and the boat would wait.
        except Exception as error:
            self.over = f"where it goes on could not be planned ({type(error).__name__}: {error})"
            return None
        part = survey_of(self.survey, new, self._sortie_in(new))
        if _goes_through(self.plan.closed, part, reached, None):
            self.over = "the way to where it would pay leads through a closed area"
            return None
        return self._ordered(new, halfway)

    def _planned(
        self, old: PlanRevision, reason: Reason, note: str, halfway: Halfway, weather: Weather
    ) -> NewOrder:
        water = self._water(halfway.place)
        if reason == "resumed":
            return self._ordered(led_on(old, self.survey, water, halfway), halfway, note)
        if reason == "progress" and self._late is not None:
            # The pace is one over what was planned, in the weather that was planned for.
            planned = self.survey.settings.weather if self.survey.settings else weather
            new = put_off(
                old, self.survey, water, halfway, self._late, vessel=self.vessel, weather=planned
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
        """The cells and the ways between them, measured when they are first needed."""
        if self._open is None:
            self._open = open_water(self.survey, water_of(self.survey))
        if not self.plan.closed:
            return self._open
        margin_m = self.survey.settings.shore_margin_m if self.survey.settings else 0.0
        zones = [zone.buffer(margin_m, quad_segs=4) for zone in self.plan.closed]
        return self._open.closing(zones, place)

    def _sailable(self) -> BaseGeometry:
        """The water in which the boat may be, without the margin that the plan keeps."""
        taken = (*self.survey.no_go, *self.plan.closed)
        if self._free is None or self._free[0] != len(taken):
            left = shapely.difference(self.survey.water, shapely.union_all(list(taken)))
            self._free = (len(taken), left.buffer(ASTRAY_M))
            shapely.prepare(self._free[1])
        return self._free[1]


def _goes_through(
    zones: Sequence[shapely.Polygon], part: Survey, reached: int, place: Place | None
) -> bool:
    """Whether what is ahead of a boat, or its place, lies in zones."""
    if not zones:
        return False
    closed = shapely.union_all(list(zones))
    shapely.prepare(closed)
    ways = [*(one.set.polygon for one in part.targets[reached:]), *part.corridors[reached:]]
    here = [] if place is None else [shapely.Point(place)]
    return bool(shapely.intersects(np.array([*ways, *here], dtype=object), closed).any())
