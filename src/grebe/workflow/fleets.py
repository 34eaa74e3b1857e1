"""Run the part of a survey that each boat of a fleet has, all at once, into one survey file."""

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
from grebe.mission.departure import Departure, prepare
from grebe.mission.loop import Mission
from grebe.mission.replanning import Extension, Replanner
from grebe.mission.rota import InTurn
from grebe.mission.safety.lookout import InFleet, Lookout
from grebe.mission.safety.states import Cause
from grebe.mission.safety.traffic import Traffic
from grebe.mission.safety.watchdog import guarded, journal_beside
from grebe.mission.safety.way_home import check_home
from grebe.mission.settings import MissionSettings
from grebe.mission.spent import AT_HOME
from grebe.mission.telling.recorders import Listener, SharedRecorder, SurveyRecorder
from grebe.mission.telling.statistics import MissionReport
from grebe.workflow.berths import by_way, harbour_of, is_afloat, lying
from grebe.workflow.collector import no_long_pauses
from grebe.workflow.handover import Handover
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

# The link of a boat, by its number and whence it departs.
FleetAt = Callable[[int, Departure], BoatLink]
# Where a boat goes on that has done its part, by what says which boats still sail.
ExtensionOf = Callable[[Callable[[], Collection[int]]], Extension]
# Ends after which a boat sails no more; another takes what it has left.
LOST = frozenset(EndReason) - {EndReason.COMPLETE, EndReason.STOPPED, EndReason.FAILED}


@dataclass(frozen=True, kw_only=True)
class FleetReport:
    """What came of the boats' missions, in the order in which they were sailed: each boat's number,
    its sortie's, and its report. `ashore`: the boats that wait at their harbours for somebody to
    see to their batteries, and have more to sail.
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

    `boat_at` opens the link of a boat by its number. `shares_time` where the boats' time is not
    the clock's, for they are simulated: they then act in turn, and have new batteries whenever they
    are at their harbours. A real boat that has come home to its harbour does not set out again in
    the same run: only who resumes it knows of its battery.

    `watches` hear of the events of each boat; `instruments` are sondes apart from a boat, by its
    number. With `replans` a boat's rest is planned anew where a target is out of reach, the current
    another or its sortie late; without it as well where an area is closed. With `extends` each boat
    goes on once it has done its part, and does that once: what it takes over from one that dropped
    out it sails, and ends. `changed` are the boats, by their numbers, whose batteries are new,
    whatever their tracks say.
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
        """Sail until every boat has done its part; what one that drops out has left is taken over
        by the nearest of the others, and sailed after its own.

        Raises `UsageError` for a survey that was not planned for a fleet, `PlanError` and
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
                f"{file.path} holds a mission already; resume it, or begin anew by force.",
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
        """Remember which boats are ashore, to sail no more in this run, and which lie about."""
        for boat, _, report in done:
            if report.ended not in AT_HOME:
                self._adrift.add(boat)
            elif self._lookouts[boat].harbour is not None and not self.shares_time:
                self._ashore.add(boat)

    def _fallen(self, done: list[tuple[int, int, MissionReport]], before: int) -> set[int]:
        """The boats that sail no more. One that came home because nothing of its sortie is open any
        more is not lost: it has done what there was; nor is one that came home for others' sake, or
        for what is renewed at its harbour: it sails the rest itself, as long as any boat gets on.
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
        """The next sortie of each boat that has one, `without` some, by the boat's number."""
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
        traffic = Traffic(apart_m=fleet.apart_m, order=by_way(departures))
        together = Together(traffic, self.survey_file)
        # Where the boats lie is known before the first of them moves; those ashore are in no way.
        for boat, departure in departures.items():
            if is_afloat(departure):
                traffic.claim(boat, np.array([departure.state[:2]]))
        for boat, place in lying(self.survey_file, departures, self._adrift).items():
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
        """The mission of a boat; its link is left, and its watchdog dismissed, with `watch`."""
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
            InTurn(link, together.rota, boat) if self.shares_time else link,
            SharedRecorder(SurveyRecorder(self.survey_file, boat), together.lock),
            self._settings_of(boat, departure),
            quantities=departure.quantities,
            listeners=[*guards, *self.watches(boat)],
            started=departure.started,
            reached=departure.reached,
            pilot=pilot_of(known, self.helm_of),
            fleet=InFleet(
                lookout=lookout,
                # Who is taken ashore need not make room for others.
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
        """What a boat that comes home for it has anew at its harbour: its battery, and the time
        that the plan gives a sortie; not the time that was given to this run.
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
            heeds=self.replans,
            extends=self.extends(together.sailing) if self.extends and goes_on else None,
        )

    def _settings_of(self, boat: int, departure: Departure) -> MissionSettings:
        """What a boat sails with: the plan's battery and time less what it has spent; a battery
        that was named for this run is the one with which it sets out first.
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
        """The settings with what is said of a boat's own battery."""
        if boat not in self.changed:
            return self.settings
        return replace(self.settings, safety=replace(self.settings.safety, used_wh=0.0))

    def _hand_over(self, fallen: set[int], lost: set[int]) -> bool:
        """Give what the fallen boats have left to the nearest that sails; False where there is
        nobody.
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
