"""Run the parts of all boats of a fleet at once, into one survey file."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np
import shapely

from grebe.core.errors import UsageError
from grebe.core.events import EndReason
from grebe.core.revision import Sortie
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Instruments
from grebe.mission.consumption import AT_HOME
from grebe.mission.departure import Departure, prepare
from grebe.mission.events.recorders import Listener, SharedRecorder, SurveyRecorder
from grebe.mission.events.statistics import MissionReport
from grebe.mission.loop import Mission
from grebe.mission.replanning import Extension, Replanner
from grebe.mission.round_robin import RoundRobinLink
from grebe.mission.safety.lookout import InFleet, Lookout
from grebe.mission.safety.route_home import check_home
from grebe.mission.safety.states import Cause
from grebe.mission.safety.traffic import Traffic
from grebe.mission.safety.watchdog import guarded, journal_beside
from grebe.mission.settings import MissionSettings
from grebe.workflow.garbage_collection import no_long_pauses
from grebe.workflow.handover import Handover
from grebe.workflow.moorings import farthest_first, harbour_of, is_afloat, moored_places
from grebe.workflow.run import (
    HelmOf,
    as_known_to,
    counting,
    pilot_of,
    say_first,
    spent_as_said,
)  # fmt: skip
from grebe.workflow.sorties import kept_by_plan
from grebe.workflow.together import Together

# Opens the link of a boat, given its number and where it departs from.
FleetAt = Callable[[int, Departure], BoatLink]
# Makes the extension of a boat's mission, given a function that returns the boats that still sail.
ExtensionOf = Callable[[Callable[[], Collection[int]]], Extension]
# A boat that ends like this sails no more; another takes over its remaining targets.
LOST = frozenset(EndReason) - {EndReason.COMPLETE, EndReason.STOPPED, EndReason.FAILED}


@dataclass(frozen=True, kw_only=True)
class FleetReport:
    """The outcome of the boats' missions.

    `missions` holds, in the order in which they were sailed, each boat's number, its sortie's, and
    its report. `ashore` are the boats that have more to sail and wait at their harbours for
    somebody to see to their batteries.
    """

    missions: tuple[tuple[int, int, MissionReport], ...]
    reached: int
    targets: int
    ashore: tuple[int, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every target was reached by some boat."""
        return self.reached == self.targets

    @property
    def goes_on(self) -> bool:
        """Whether all went as planned, and boats wait ashore for their next sorties."""
        ends = {report.ended for *_, report in self.missions}
        return bool(self.ashore) and ends == {EndReason.COMPLETE}

    @property
    def stopped(self) -> bool:
        """Whether somebody stopped it."""
        return any(report.ended is EndReason.STOPPED for *_, report in self.missions)

    @property
    def duration_s(self) -> float:
        """The longest time that one boat sailed [s]."""
        spent: dict[int, float] = {}
        for boat, _, report in self.missions:
            spent[boat] = spent.get(boat, 0.0) + report.duration_s
        return max(spent.values(), default=0.0)


@dataclass
class FleetRun:
    """One survey file, its boats, and how they are steered.

    `boat_at` opens the link of a boat by its number. `shares_time` is set for simulated boats,
    whose time is not the clock's: they act in turn, and have new batteries whenever they are at
    their harbours. A real boat that has come home to its harbour does not set out again in the same
    run: only whoever resumes it knows about its battery.

    `watches` receive the events of each boat; `instruments` are sondes apart from a boat, by its
    number. With `replans` a boat's rest is replanned when a target is out of reach, the current has
    changed or its sortie is late; when an area is closed, this happens without it as well. With
    `extends` each boat goes on once it has done its part, but only once: after what it takes over
    from a boat that dropped out, it ends. `changed` are the numbers of the boats that have new
    batteries, whatever their tracks say.
    """

    survey_file: SurveyFile
    boat_at: FleetAt
    helm_of: HelmOf
    settings: MissionSettings = field(default_factory=MissionSettings)
    shares_time: bool = True
    watches: Callable[[int], Sequence[Listener]] = lambda _: ()
    on_ready: Callable[[int, Mission], None] | None = None
    instruments: Mapping[int, Instruments] = field(default_factory=dict[int, Instruments])
    replans: bool = False
    extends: ExtensionOf | None = None
    changed: Collection[int] = ()
    _sailed: set[int] = field(default_factory=set[int])
    _shut: set[int] = field(default_factory=set[int])
    _lookouts: dict[int, Lookout] = field(default_factory=dict[int, Lookout])
    _ashore: set[int] = field(default_factory=set[int])
    _adrift: set[int] = field(default_factory=set[int])
    _closed: tuple[shapely.Polygon, ...] = ()

    def run(self, now: datetime, *, resume: bool = False, force: bool = False) -> FleetReport:
        """Sail until every boat has done its part.

        If a boat drops out, the nearest of the others takes over its remaining targets, after its
        own.

        Raises `UsageError` for a survey that was not planned for a fleet, and `PlanError` and
        `SurveyFileError` as `prepare` does.
        """
        file = self.survey_file
        if file.survey.fleet is None:
            raise UsageError("The survey is not planned for several boats.", settings=("boats",))
        file.claim()
        if force:
            file.clear_mission()
        elif file.track_ends() and not resume:
            raise UsageError(
                f"{file.path} already holds a mission; resume it, or start again by force.",
                settings=("resume", "force"),
            )
        file.begin_session(now)
        missions: list[tuple[int, int, MissionReport]] = []
        lost: set[int] = set()
        while rounds := self._next_round(lost | self._ashore):
            before = file.progress().reached
            done = self._sail(rounds, now)
            missions += done
            self._note_ends(done)
            fallen = self._fallen(done, before)
            lost |= fallen
            stopped = any(one.ended in (EndReason.STOPPED, EndReason.FAILED) for *_, one in done)
            if stopped or not self._hand_over(fallen, lost):
                break
        progress = file.progress()
        return FleetReport(
            missions=tuple(missions),
            reached=progress.reached,
            targets=len(progress.reached_at),
            ashore=tuple(sorted(self._ashore & set(self._next_round(lost)))),
        )

    def _note_ends(self, done: list[tuple[int, int, MissionReport]]) -> None:
        """Note which boats are ashore, to sail no more in this run, and which are adrift."""
        for boat, _, report in done:
            if report.ended not in AT_HOME:
                self._adrift.add(boat)
            elif self._lookouts[boat].harbour is not None and not self.shares_time:
                self._ashore.add(boat)

    def _fallen(self, done: list[tuple[int, int, MissionReport]], before: int) -> set[int]:
        """Return the boats that sail no more.

        A boat is not lost if it came home because nothing of its sortie is open any more: there was
        nothing more to do. Nor is one that came home for the sake of others, or for what is renewed
        at its harbour: it sails the rest itself, as long as any boat makes progress.
        """
        fallen: set[int] = set()
        gets_on = self.survey_file.progress().reached > before
        for boat, number, report in done:
            came_home = report.ended is EndReason.CAME_HOME
            if came_home and gets_on and self._lookouts[boat].sails_again:
                continue
            if came_home and self._closed and self._handover.is_shut(number):
                self._shut.add(number)
            elif report.ended in LOST:
                fallen.add(boat)
        return fallen

    def _next_round(self, without: Collection[int]) -> dict[int, Sortie]:
        """Return the next sortie of each boat that has one, by its number, `without` some boats."""
        progress = self.survey_file.progress()
        found: dict[int, Sortie] = {}
        for one in self.survey_file.revision.sorties:
            left = progress.reached_in(one) < len(one) and one.number not in self._shut
            if left and one.boat not in without:
                found.setdefault(one.boat, one)
        return found

    def _sail(
        self, sorties: dict[int, Sortie], now: datetime
    ) -> list[tuple[int, int, MissionReport]]:
        """Sail one sortie of each boat, all at once."""
        fleet = self.survey_file.survey.fleet
        assert fleet is not None
        departures = {
            boat: self._departure(sortie, now) for boat, sortie in sorted(sorties.items())
        }
        for departure in departures.values():
            check_home(departure.survey, self.settings.safety)
        traffic = Traffic(apart_m=fleet.apart_m, order=farthest_first(departures))
        together = Together(traffic, self.survey_file)
        # The places of the boats are known before the first of them moves. Those ashore are in
        # nobody's way.
        for boat, departure in departures.items():
            if is_afloat(departure):
                traffic.claim(boat, np.array([departure.state[:2]]))
        for boat, place in moored_places(self.survey_file, departures, self._adrift).items():
            traffic.claim(boat, np.array([place]))
            traffic.leave(boat)
        say_first(next(iter(departures.values())), self.survey_file, self.watches(min(departures)))
        with ExitStack() as watch, no_long_pauses():
            missions = {
                boat: self._mission(sorties[boat], departure, together, watch)
                for boat, departure in departures.items()
            }
            reports = together.run(missions, shares_time=self.shares_time)
            self._closed = together.plan.closed
        return [(boat, sorties[boat].number, report) for boat, report in sorted(reports.items())]

    def _mission(
        self, sortie: Sortie, departure: Departure, together: Together, watch: ExitStack
    ) -> Mission:
        """Return the mission of a boat.

        `watch` closes its link and dismisses its watchdog at the end.
        """
        boat = sortie.boat
        link = self.boat_at(boat, departure)
        watch.callback(link.close)
        known = as_known_to(link, departure)
        helm = self.helm_of(known)
        guards = watch.enter_context(guarded(link, journal_beside(self.survey_file.path)))
        harbour = harbour_of(departure)
        lookout = Lookout(
            traffic=together.traffic,
            boat=boat,
            harbour=harbour,
            is_afloat=is_afloat(departure),
            renewed=self._renewed if harbour else (),
        )
        self._lookouts[boat] = lookout
        mission = Mission(
            departure.survey,
            helm,
            RoundRobinLink(link, together.turns, boat) if self.shares_time else link,
            SharedRecorder(SurveyRecorder(self.survey_file, boat), together.lock),
            self._settings_of(boat, departure),
            quantities=departure.quantities,
            listeners=[*guards, *self.watches(boat)],
            started=departure.started,
            reached=departure.reached,
            pilot=pilot_of(known, self.helm_of),
            fleet=InFleet(
                lookout=lookout,
                # A boat that is taken ashore need not make room for others.
                stands_by=lambda: harbour is None and together.others_sail(boat),
            ),
            instruments=self.instruments.get(boat),
            replanner=self._replanner(sortie, known, together),
        )
        if self.on_ready is not None:
            self.on_ready(boat, mission)
        return mission

    @property
    def _renewed(self) -> tuple[Cause, ...]:
        """The causes of coming home that a stay at the harbour removes.

        These are the battery, and the time that the plan gives a sortie, but not the time that was
        given to this run.
        """
        of_plan = math.isinf(self.settings.safety.max_s)
        return (Cause.BATTERY, Cause.TIME) if of_plan else (Cause.BATTERY,)

    def _replanner(self, sortie: Sortie, departure: Departure, together: Together) -> Replanner:
        goes_on = self.extends is not None and sortie.boat not in self._sailed
        self._sailed.add(sortie.boat)
        return Replanner(
            survey=self.survey_file.survey,
            plan=together.plan,
            vessel=departure.vessel,
            helm_of=pilot_of(departure, self.helm_of),
            sortie=sortie.number,
            spent_s=departure.spent.seconds,
            waits=self.shares_time,
            reacts=self.replans,
            extends=self.extends(together.sailing) if self.extends and goes_on else None,
        )

    def _settings_of(self, boat: int, departure: Departure) -> MissionSettings:
        """Return a boat's settings: the plan's battery and time, minus what it has spent.

        A battery state that was given for this run applies to the first departure only.
        """
        settings = self._as_said_of(boat)
        if boat in self._sailed:
            settings = replace(settings, safety=replace(settings.safety, used_wh=None))
        kept = kept_by_plan(settings.safety, departure.survey, departure.spent)
        return counting(replace(settings, safety=kept), departure)

    def _departure(self, sortie: Sortie, now: datetime) -> Departure:
        resume = self.survey_file.track_ends(sortie.boat) is not None
        departure = prepare(
            self.survey_file, now, resume=resume, sortie=sortie.number, renews=self.shares_time
        )
        if sortie.boat in self._sailed:
            return departure
        return spent_as_said(departure, self._as_said_of(sortie.boat))

    def _as_said_of(self, boat: int) -> MissionSettings:
        """Return the settings of a boat; a battery that was changed has spent nothing."""
        if boat not in self.changed:
            return self.settings
        return replace(self.settings, safety=replace(self.settings.safety, used_wh=0.0))

    def _hand_over(self, fallen: set[int], lost: set[int]) -> bool:
        """Give the fallen boats' remaining targets to the nearest that sails.

        Returns False if nobody sails.
        """
        file = self.survey_file
        boats = {one.boat for one in file.revision.sorties} - lost
        if not fallen:
            return True
        if not boats:
            return False
        self._handover.give(lost, boats)
        return True

    @property
    def _handover(self) -> Handover:
        return Handover(survey_file=self.survey_file, closed=self._closed, adrift=self._adrift)
