"""The places of a fleet's idle boats, and the order in which the others set out."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from grebe.io.store import SurveyFile
from grebe.mission.consumption import AT_HARBOUR_M
from grebe.mission.departure import Departure
from grebe.mission.safety.states import Place


def harbour_of(departure: Departure) -> Place | None:
    """Return where a boat is launched and taken ashore again; None if it has no harbour."""
    survey = departure.survey
    if survey.start is None or survey.settings is None or survey.settings.sorties is None:
        return None
    return survey.start.north_m, survey.start.east_m


def is_afloat(departure: Departure) -> bool:
    """Return whether a boat begins its mission on the water, and not ashore at its harbour."""
    harbour = harbour_of(departure)
    return harbour is None or math.dist(harbour, departure.state[:2]) >= AT_HARBOUR_M


def farthest_first(departures: Mapping[int, Departure]) -> tuple[int, ...]:
    """Return the boats in the order in which they set out.

    The boat that goes farthest from its harbour is first, because boats cannot pass each other in
    narrow water. Boats without a harbour are ordered by their numbers.
    """

    def farthest_m(departure: Departure) -> float:
        harbour = harbour_of(departure)
        if harbour is None:
            return 0.0
        return max(math.dist(harbour, one.centre) for one in departure.survey.sets)

    return tuple(sorted(departures, key=lambda boat: (-farthest_m(departures[boat]), boat)))


def moored_places(
    survey_file: SurveyFile, sailing: Collection[int], adrift: Collection[int] = ()
) -> dict[int, Place]:
    """Return the places (north, east) of idle boats on the water, by their numbers.

    These boats have sailed and are not `sailing`. A boat at a harbour has been taken ashore, unless
    it is `adrift`: it has not come home, and nobody has been there since.
    """
    survey = survey_file.survey
    assert survey.fleet is not None
    has_harbours = survey.settings is not None and survey.settings.sorties is not None
    sorties = survey_file.revision.sorties if has_harbours else ()
    harbours = [(one.start.north_m, one.start.east_m) for one in sorties]
    found: dict[int, Place] = {}
    for boat in range(1, survey.fleet.boats + 1):
        ends = None if boat in sailing else survey_file.track_ends(boat)
        if ends is None:
            continue
        place = (ends[1].state[0], ends[1].state[1])
        if boat in adrift or all(math.dist(place, one) >= AT_HARBOUR_M for one in harbours):
            found[boat] = place
    return found
