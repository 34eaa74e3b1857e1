"""Run the part of a survey that each boat of a fleet has, all at once, into one survey file."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np
import shapely

from grebe.core.errors import PlanError, UsageError
from grebe.core.events import EndReason
from grebe.core.revision import PlanRevision, Sortie, as_planned, survey_of
from grebe.core.survey import Pose
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Instruments
from grebe.mission.departure import Departure, prepare
from grebe.mission.lookout import InFleet, Lookout
from grebe.mission.loop import Mission
from grebe.mission.recorders import Listener, SharedRecorder, SurveyRecorder
from grebe.mission.replanning import Extension, KeptPlan, Replanner
from grebe.mission.rota import InTurn, Rota
from grebe.mission.safety.states import Place
from grebe.mission.safety.traffic import WANDER_M, Traffic
from grebe.mission.settings import MissionSettings
from grebe.mission.statistics import MissionReport
from grebe.mission.watchdog import guarded, journal_beside
from grebe.mission.way_home import check_home
from grebe.planning.region import water_of
from grebe.planning.revisions.revise import Halfway, open_water, replanned
from grebe.workflow.berths import by_way, harbour_of, is_afloat, lying
from grebe.workflow.collector import no_long_pauses
from grebe.workflow.run import (
    HelmOf,
    as_known_to,
    counting,
    pilot_of,
    say_first,
    spent_as_said,
)  # fmt: skip
from grebe.workflow.sorties import kept_by_plan

# The link of a boat, by its number and whence it departs.
FleetAt = Callable[[int, Departure], BoatLink]
# Where a boat goes on that has done its part, by what says which boats still sail.
ExtensionOf = Callable[[Callable[[], Collection[int]]], Extension]
# How long missions have for their last words when all is stopped [s].
LAST_WORDS_S = 0.5
# Ends after which a boat sails no more; another takes what it has left.
LOST = frozenset(EndReason) - {EndReason.COMPLETE, EndReason.STOPPED, EndReason.FAILED}


@dataclass(frozen=True, kw_only=True)
class FleetReport:
    """What came of the boats' missions, in the order in which they were sailed: each boat's number,
    its sortie's, and its report.
    """

    missions: tuple[tuple[int, int, MissionReport], ...]
    reached: int
    targets: int

    @property
    def complete(self) -> bool:
        """Whether every target was reached by some boat."""
        return self.reached == self.targets

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


class _Together:
    """What the missions of one round share: the boats that still have something to do among it."""

    def __init__(self, traffic: Traffic, file: SurveyFile) -> None:
        boats = list(traffic.order)
        self.traffic, self.rota, self.lock = traffic, Rota(boats), threading.Lock()
        self.plan = KeptPlan(revision=file.revision, keep=self._keep)
        self._file = file
        self._busy = set(boats)
        self._sailing = set(boats)

    def _keep(self, revision: PlanRevision) -> None:
        with self.lock:
            self._file.append_revision(revision)

    def sailing(self) -> set[int]:
        """The boats whose missions are not over."""
        with self.lock:
            return set(self._sailing)

    def others_sail(self, boat: int) -> bool:
        """Whether others still sail when this boat has done its part."""
        with self.lock:
            self._busy.discard(boat)
            return bool(self._busy)

    def run(self, missions: dict[int, Mission], *, shares_time: bool) -> dict[int, MissionReport]:
        """Sail all of them; raises what one of them raised, once all are over."""
        reports: dict[int, MissionReport] = {}
        failures: list[BaseException] = []

        def sail(boat: int, mission: Mission) -> None:
            try:
                if shares_time:
                    self.rota.wait(boat)
                reports[boat] = mission.run()
            except BaseException as error:
                failures.append(error)
            finally:
                self.rota.leave(boat)
                self.traffic.leave(boat)
                self.others_sail(boat)
                with self.lock:
                    self._sailing.discard(boat)

        threads = [
            threading.Thread(target=sail, args=pair, daemon=True) for pair in missions.items()
        ]
        for thread in threads:
            thread.start()
        try:
            for thread in threads:
                thread.join()
        except BaseException:
            # Somebody stops it all: the missions end by themselves, and write until then.
            for thread in threads:
                thread.join(LAST_WORDS_S)
            raise
        if failures:
            raise failures[0]
        return reports


@dataclass
class FleetRun:
    """One survey file, its boats, and how they are steered.

    `boat_at` opens the link of a boat by its number; `shares_time` where the boats' time is not
    the clock's: they then act in turn. `watches` hear of the events of each boat; `instruments`
    are sondes apart from a boat, by its number. With `replans` a boat's rest is planned anew where
    a target is out of reach, the current another or its sortie late; without it as well where an
    area is closed. With `extends` each boat goes on once it has done its part, and does that once:
    what it takes over from one that dropped out it sails, and ends.
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
    _sailed: set[int] = field(default_factory=set[int])
    _shut: set[int] = field(default_factory=set[int])
    _lookouts: dict[int, Lookout] = field(default_factory=dict[int, Lookout])
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
        while rounds := self._next_round(lost):
            before = file.progress().reached
            done = self._sail(rounds, now)
            missions += done
            fallen = self._fallen(done, before)
            lost |= fallen
            stopped = any(one.ended in (EndReason.STOPPED, EndReason.FAILED) for *_, one in done)
            if stopped or not self._hand_over(fallen, lost):
                break
        progress = file.progress()
        return FleetReport(
            missions=tuple(missions), reached=progress.reached, targets=len(progress.reached_at)
        )

    def _fallen(self, done: list[tuple[int, int, MissionReport]], before: int) -> set[int]:
        """The boats that sail no more. One that came home because nothing of its sortie is open any
        more is not lost: it has done what there was; nor is one that came home for
        others' sake, or for its time or battery: it sets out again, as long as any boat gets on.
        """
        fallen: set[int] = set()
        gets_on = self.survey_file.progress().reached > before
        for boat, number, report in done:
            if report.ended is EndReason.CAME_HOME and gets_on and self._lookouts[boat].sails_again:
                continue
            if report.ended is EndReason.CAME_HOME and self._closed and self._is_shut(number):
                self._shut.add(number)
            elif report.ended in LOST:
                fallen.add(boat)
        return fallen

    def _is_shut(self, number: int) -> bool:
        """Whether nothing that a sortie has left can be gone to, for it is closed."""
        file = self.survey_file
        sortie = file.revision.sortie(number)
        ends = file.track_ends(sortie.boat)
        assert ends is not None
        place = (ends[1].state[0], ends[1].state[1])
        reached = file.progress().reached_in(sortie)
        try:
            self._replanned(sortie, reached, place, self._vessel_of(sortie.boat))
        except PlanError:
            return True
        return False

    def _next_round(self, lost: set[int]) -> dict[int, Sortie]:
        """The next sortie of each boat that sails, by the boat's number."""
        progress = self.survey_file.progress()
        found: dict[int, Sortie] = {}
        for one in self.survey_file.revision.sorties:
            left = progress.reached_in(one) < len(one) and one.number not in self._shut
            if left and one.boat not in lost:
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
        together = _Together(traffic, self.survey_file)
        # Where the boats lie is known before the first of them moves; those ashore are in no way.
        for boat, departure in departures.items():
            if is_afloat(departure):
                traffic.claim(boat, np.array([departure.state[:2]]))
        for boat, place in lying(self.survey_file, departures).items():
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
        self, sortie: Sortie, departure: Departure, together: _Together, watch: ExitStack
    ) -> Mission:
        """The mission of a boat; its link is left, and its watchdog dismissed, with `watch`."""
        boat = sortie.boat
        link = self.boat_at(boat, departure)
        watch.callback(link.close)
        known = as_known_to(link, departure)
        helm = self.helm_of(known)
        guards = watch.enter_context(guarded(link, journal_beside(self.survey_file.path)))
        lookout = Lookout(
            traffic=together.traffic,
            boat=boat,
            harbour=harbour_of(departure),
            is_afloat=is_afloat(departure),
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
                stands_by=lambda: lookout.harbour is None and together.others_sail(boat),
            ),
            instruments=self.instruments.get(boat),
            replanner=self._replanner(sortie, known, together),
        )
        if self.on_ready is not None:
            self.on_ready(boat, mission)
        return mission

    def _replanner(self, sortie: Sortie, departure: Departure, together: _Together) -> Replanner:
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
        settings = self.settings
        if boat in self._sailed:
            settings = replace(settings, safety=replace(settings.safety, used_wh=None))
        kept = kept_by_plan(settings.safety, departure.survey, departure.spent)
        return counting(replace(settings, safety=kept), departure)

    def _departure(self, sortie: Sortie, now: datetime) -> Departure:
        resume = self.survey_file.track_ends(sortie.boat) is not None
        departure = prepare(self.survey_file, now, resume=resume, sortie=sortie.number)
        return departure if sortie.boat in self._sailed else spent_as_said(departure, self.settings)

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
        for sortie in [one for one in file.revision.sorties if one.boat in lost]:
            self._take_over(sortie, boats)
        return True

    def _take_over(self, sortie: Sortie, boats: set[int]) -> None:
        file = self.survey_file
        reached = file.progress().reached_in(sortie)
        if reached == len(sortie):
            return
        places = {boat: end[1].state[:2] for boat in boats if (end := file.track_ends(boat))}
        if not places:
            return
        first = file.revision.targets[sortie.first - 1 + reached].set.centre

        def away(boat: int) -> float:
            north, east = places[boat]
            return (north - first[0]) ** 2 + (east - first[1]) ** 2

        heir = min(places, key=away)
        fleet = file.survey.fleet
        assert fleet is not None
        radius_m = fleet.apart_m + 2 * WANDER_M
        about = [shapely.Point(at).buffer(radius_m) for at in lying(file, boats).values()]
        try:
            new = self._replanned(sortie, reached, places[heir], self._vessel_of(heir), about)
        # What is left is closed, or the way to the harbour alone: there is nothing to take over.
        except PlanError:
            return
        north, east = places[heir]
        taken = {"boat": heir, "start": Pose(north_m=north, east_m=east)}
        sorties = [
            replace(one, **taken) if one.number == sortie.number else one for one in new.sorties
        ]
        file.append_revision(replace(new, sorties=tuple(sorties)))

    def _vessel_of(self, boat: int) -> Vessel:
        vessel = self.survey_file.survey.vessel_of(boat)
        if vessel is None:
            raise PlanError("The survey does not say for which vessel it was planned.")
        return vessel

    def _replanned(
        self,
        sortie: Sortie,
        reached: int,
        place: Place,
        vessel: Vessel,
        about: Sequence[shapely.Polygon] = (),
    ) -> PlanRevision:
        """The plan in which the rest of a sortie is planned anew, out of what is closed and of the
        water `about` boats that lie in it.
        """
        survey, revision = self.survey_file.survey, self.survey_file.revision
        weather = survey.settings.weather if survey.settings else None
        if weather is None:
            raise PlanError("The survey does not say for which weather it was planned.")
        # Where boats had gone on to of themselves need not be taken over: it was not planned.
        planned = survey_of(survey, as_planned(self.survey_file.revisions()))
        open_ = open_water(planned, water_of(survey))
        closed = [*self._closed, *about]
        return replanned(
            revision,
            survey,
            open_.closing(closed, place) if closed else open_,
            Halfway(reached=reached, place=place, sortie=sortie),
            vessel=vessel,
            weather=weather,
            reason="boat_lost",
            note=f"boat {sortie.boat} dropped out, and another takes what it has left",
        )
