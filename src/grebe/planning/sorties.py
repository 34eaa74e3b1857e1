"""Cut a survey into sorties: trips from a harbour and back, each as long as a battery lasts.

`grebe.planning.trips.fewest_trips` assigns the cells to trips. This module makes each trip a
survey of its own, and all of them one revision of the plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import shapely

from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import Vessel
from grebe.planning.fleets.fleet_times import MOVE_S
from grebe.planning.fleets.unlike_sorties import share_sorties
from grebe.planning.merge import checked, merged
from grebe.planning.planned import PlannedSorties
from grebe.planning.planner import Draft, Planner, planner_of
from grebe.planning.region import Region
from grebe.planning.trips.endurance import endurance_of
from grebe.planning.trips.fewest_trips import Trips, trips_within
from grebe.planning.trips.lake import Lake, lake_of
from grebe.planning.trips.trip_surveys import trip_surveys


def plan_sorties(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
    on_done: Callable[[int, int], None] | None = None,
) -> PlannedSorties:
    """Plan a survey of a region in sorties. Raises `PlanError` with the reason when there is none.

    Without a harbour the sorties begin and end at the start. In a fleet of identical boats the
    sorties are dealt out to them. Unlike boats, and boats with starts of their own, share the
    cells out first. `on_done` is called with the progress of the search.
    """
    sorties = settings.sorties
    if sorties is None:
        raise UsageError(
            "Sorties need a limit; give the battery's watt-hours or the minutes.",
            settings=("sortie_minutes",),
        )
    fleet = settings.fleet
    if fleet is not None and fleet.starts and sorties.harbours:
        raise UsageError(
            "Sorties begin and end at harbours for all boats, or at a start of each boat's own; "
            "give one or the other.",
            settings=("harbours", "starts"),
        )
    places = [region.frame.place_near(region.water, one, "harbour") for one in sorties.harbours]
    start = start_lonlat or (sorties.harbours[0] if sorties.harbours else None)
    planner, notes = planner_of(region, vessel, settings, start, no_go)
    # If trips are dealt out, the order only says how much longer paths take than their legs.
    draft = planner.first_draft(quick=not _is_shared(settings))
    return sorties_through(planner, draft, places, notes, on_done)


def sorties_through(
    planner: Planner,
    draft: Draft,
    places: Sequence[tuple[float, float]],
    notes: tuple[str, ...] = (),
    on_done: Callable[[int, int], None] | None = None,
    rounds: int | None = None,
) -> PlannedSorties:
    """Plan sorties through the cells of a draft's order, which need not be all of its cells.

    The harbours are at `places` (north, east), or at the draft's start. `rounds` is the length of
    the search for trips (None: by the number of cells). See `plan_sorties`.
    """
    settings, fleet = planner.settings, planner.settings.fleet
    if _is_shared(settings):
        return share_sorties(planner, draft, places, notes, on_done, rounds)
    lake = lake_of(planner, draft, places or [draft.start]).part(draft.route.order)
    endurance = endurance_of(planner.vessel, settings, planner.mean_power_w(draft))
    trips = trips_within(lake, endurance, rounds, on_done)
    planned = _laid_out(lake, trips, notes)
    return planned if fleet is None else dealt(planned, fleet.boats)


def _is_shared(settings: PlanSettings) -> bool:
    """Whether a fleet's boats share the cells out before the search for trips."""
    fleet, sorties = settings.fleet, settings.sorties
    if fleet is None or sorties is None:
        return False
    return bool(fleet.vessels or fleet.starts or sorties.are_unlike)


def _laid_out(lake: Lake, trips: Trips, notes: tuple[str, ...]) -> PlannedSorties:
    """The plan of some trips."""
    planner, bound_m = lake.planner, lake.planner.bound_m(lake.draft)
    survey, revision = merged(trip_surveys(lake, trips, bound_m), bound_m)
    assert survey.outcome is not None
    return PlannedSorties(
        survey=survey, outcome=survey.outcome, check=checked(survey, revision, planner.water),
        notes=notes, revision=revision, bound_s=trips.bound_s, legs_s=trips.legs_s,
    )  # fmt: skip


def dealt(planned: PlannedSorties, boats: int) -> PlannedSorties:
    """Deal sorties out to boats, the longest first, each to the boat with the least to do. A boat
    that would have to be taken to another harbour counts as having `MOVE_S` more to do.
    """
    load, harbours = [0.0] * boats, [set[tuple[int, int]]() for _ in range(boats)]
    of: dict[int, int] = {}
    for one in sorted(planned.revision.sorties, key=lambda one: -one.time_s):
        harbour = round(one.start.north_m), round(one.start.east_m)
        ahead = [
            spent + (MOVE_S if own and harbour not in own else 0.0)
            for spent, own in zip(load, harbours, strict=True)
        ]
        boat = ahead.index(min(ahead))
        load[boat] += one.time_s
        harbours[boat].add(harbour)
        of[one.number] = boat + 1
    sorties = tuple(replace(one, boat=of[one.number]) for one in planned.revision.sorties)
    return replace(planned, revision=replace(planned.revision, sorties=sorties))
