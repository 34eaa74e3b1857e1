"""Sail the missions of a fleet's boats at once, each in a thread of its own."""

from __future__ import annotations

import threading

from grebe.core.revision import PlanRevision
from grebe.io.store import SurveyFile
from grebe.mission.events.statistics import MissionReport
from grebe.mission.loop import Mission
from grebe.mission.replanning import SharedPlan
from grebe.mission.round_robin import RoundRobin
from grebe.mission.safety.traffic import Traffic

# The time that missions have to end when everything is stopped [s].
LAST_WORDS_S = 0.5


class Together:
    """The state that the missions of one round share, such as which boats are still busy."""

    def __init__(self, traffic: Traffic, file: SurveyFile) -> None:
        boats = list(traffic.order)
        self.traffic, self.turns, self.lock = traffic, RoundRobin(boats), threading.Lock()
        self.plan = SharedPlan(revision=file.revision, keep=self._keep)
        self._file = file
        self._busy = set(boats)
        self._sailing = set(boats)

    def _keep(self, revision: PlanRevision) -> None:
        with self.lock:
            self._file.append_revision(revision)

    def sailing(self) -> set[int]:
        """Return the boats whose missions are not over."""
        with self.lock:
            return set(self._sailing)

    def others_sail(self, boat: int) -> bool:
        """Note that this boat has done its part, and return whether others still sail."""
        with self.lock:
            self._busy.discard(boat)
            return bool(self._busy)

    def run(self, missions: dict[int, Mission], *, shares_time: bool) -> dict[int, MissionReport]:
        """Sail all missions; once all are over, raise what one of them raised."""
        reports: dict[int, MissionReport] = {}
        failures: list[BaseException] = []

        def sail(boat: int, mission: Mission) -> None:
            try:
                if shares_time:
                    self.turns.wait(boat)
                reports[boat] = mission.run()
            except BaseException as error:
                failures.append(error)
            finally:
                self.turns.leave(boat)
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
            # Everything is being stopped: the missions end by themselves, and write until then.
            for thread in threads:
                thread.join(LAST_WORDS_S)
            raise
        if failures:
            raise failures[0]
        return reports
