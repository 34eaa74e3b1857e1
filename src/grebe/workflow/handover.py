"""Hand the remaining targets of a lost boat to the nearest of the fleet's others."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import shapely

from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision, Sortie, as_planned, survey_of
from grebe.core.survey import Pose
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile
from grebe.mission.safety.states import Place
from grebe.mission.safety.traffic import WANDER_M
from grebe.planning.region import water_of
from grebe.planning.revisions.revise import Halfway, open_water, replanned
from grebe.workflow.moorings import moored_places


@dataclass(frozen=True, kw_only=True)
class Handover:
    """Replans the remaining targets of sorties in a survey file.

    The new plan keeps out of what is `closed`, and out of the water around idle boats. Boats that
    are `adrift` count as such even at a harbour.
    """

    survey_file: SurveyFile
    closed: Sequence[shapely.Polygon]
    adrift: Collection[int]

    def is_shut(self, number: int) -> bool:
        """Return whether all remaining targets of a sortie are closed."""
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

    def give(self, lost: Collection[int], boats: Collection[int]) -> None:
        """Give the lost boats' remaining targets to the nearest of the sailing `boats`.

        This is done sortie by sortie, each as a revision of the plan.
        """
        for sortie in [one for one in self.survey_file.revision.sorties if one.boat in lost]:
            self._take_over(sortie, boats)

    def _take_over(self, sortie: Sortie, boats: Collection[int]) -> None:
        file = self.survey_file
        reached = file.progress().reached_in(sortie)
        if reached == len(sortie):
            return
        places = {boat: end[1].state[:2] for boat in boats if (end := file.track_ends(boat))}
        if not places:
            return
        first = file.revision.targets[sortie.first - 1 + reached].set.centre
        heir = min(places, key=lambda boat: math.dist(places[boat], first))
        about = self._about_lying(boats)
        try:
            new = self._replanned(sortie, reached, places[heir], self._vessel_of(heir), about)
        # The rest is closed, or is only the way to the harbour: there is nothing to take over.
        except PlanError:
            return
        north, east = places[heir]
        taken = {"boat": heir, "start": Pose(north_m=north, east_m=east)}
        sorties = [
            replace(one, **taken) if one.number == sortie.number else one for one in new.sorties
        ]
        file.append_revision(replace(new, sorties=tuple(sorties)))

    def _about_lying(self, boats: Collection[int]) -> list[shapely.Polygon]:
        """Return the water that is kept free around idle boats, which are all but `boats`."""
        fleet = self.survey_file.survey.fleet
        assert fleet is not None
        radius_m = fleet.apart_m + 2 * WANDER_M
        places = moored_places(self.survey_file, boats, self.adrift).values()
        return [shapely.Point(at).buffer(radius_m) for at in places]

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
        """Return the plan with the rest of a sortie replanned from a place on."""
        survey, revision = self.survey_file.survey, self.survey_file.revision
        weather = survey.settings.weather if survey.settings else None
        if weather is None:
            raise PlanError("The survey does not say for which weather it was planned.")
        # Places that boats had added themselves were not planned, and need not be taken over.
        planned = survey_of(survey, as_planned(self.survey_file.revisions()))
        open_ = open_water(planned, water_of(survey))
        closed = [*self.closed, *about]
        return replanned(
            revision,
            survey,
            open_.closing(closed, place) if closed else open_,
            Halfway(reached=reached, place=place, sortie=sortie),
            vessel=vessel,
            weather=weather,
            reason="boat_lost",
            note=f"boat {sortie.boat} dropped out; another takes over its remaining targets",
        )
