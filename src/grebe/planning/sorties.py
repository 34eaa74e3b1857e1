"""Cut a survey into sorties: trips from a harbour and back, each as long as a battery lasts.

Which cells a trip takes `grebe.planning.fewest_trips` finds; here each becomes a survey of its own
and all of them one revision of the plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanOutcome, PlanSettings
from grebe.core.revision import PlanRevision, Sortie, first_revision, survey_of
from grebe.core.survey import Survey, Target, covered_share, overlap_m2
from grebe.core.vessel import Vessel
from grebe.planning.check import PlanCheck, check_plan
from grebe.planning.endurance import endurance_of
from grebe.planning.fewest_trips import Trips, trips_within
from grebe.planning.lake import Lake, lake_of
from grebe.planning.planned import PlannedSorties
from grebe.planning.planner import Draft, planner_of
from grebe.planning.region import Region
from grebe.planning.route import Route

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# A harbour's last target: a square of so many metres about it, or half of a smaller cell.
HARBOUR_M = 6.0
# What it takes to bring a boat to another harbour by land [s].
MOVE_S = 1800.0


def plan_sorties(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
    on_done: Callable[[int, int], None] | None = None,
) -> PlannedSorties:
    """Plan a survey of a region in sorties; `PlanError` says why there is none.

    Without a harbour the sorties begin and end at the start. `on_done` hears how far the search is.
    """
    sorties = settings.sorties
    if sorties is None:
        raise UsageError("What bounds a sortie is not given.", settings=("sortie_minutes",))
    if settings.fleet is not None and settings.fleet.vessels:
        raise UsageError(
            "Sorties are dealt out to boats of one kind: each must fit into any boat's battery.",
            settings=("vessel", "sortie_battery_wh", "sortie_minutes"),
        )
    places = [region.frame.place_near(region.water, one, "harbour") for one in sorties.harbours]
    start = start_lonlat or (sorties.harbours[0] if sorties.harbours else None)
    planner, notes = planner_of(region, vessel, settings, start, no_go)
    draft = planner.first_draft(quick=True)
    lake = lake_of(planner, draft, places or [draft.start])
    endurance = endurance_of(vessel, settings, planner.mean_power_w(draft))
    trips = trips_within(lake, endurance, on_done=on_done)
    planned = _laid_out(lake, trips, notes)
    return planned if settings.fleet is None else dealt(planned, settings.fleet.boats)


def _laid_out(lake: Lake, trips: Trips, notes: tuple[str, ...]) -> PlannedSorties:
    """The survey of some trips: targets, ways around land and corridors of each."""
    planner, bound_m = lake.planner, lake.planner.bound_m(lake.draft)
    parts = [
        planner.survey(_trip_draft(lake, harbour, order), lake.ways, bound_m)
        for harbour, order in zip(trips.harbours.tolist(), trips.orders, strict=True)
    ]
    survey, revision = put_together(parts, bound_m)
    assert survey.outcome is not None
    return PlannedSorties(
        survey=survey, outcome=survey.outcome, check=checked(survey, revision, planner.water),
        notes=notes, revision=revision, bound_s=trips.bound_s, legs_s=trips.legs_s,
    )  # fmt: skip


def dealt(planned: PlannedSorties, boats: int) -> PlannedSorties:
    """Deal sorties out to boats, the longest first, each to the boat that has least to do; one that
    would have to be taken to another harbour counts as having `MOVE_S` more.
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


def put_together(
    parts: Sequence[Survey], bound_m: float, boats: Sequence[int] = ()
) -> tuple[Survey, PlanRevision]:
    """Return one survey of several, its targets numbered on, with each as a sortie; `boats` are
    those that sail them, the first without.
    """
    targets: list[Target] = []
    sorties: list[Sortie] = []
    for number, part in enumerate(parts, 1):
        outcome, start = part.outcome, part.start
        assert outcome is not None
        assert start is not None
        first = len(targets) + 1
        targets += [replace(t, seq=i) for i, t in enumerate(part.targets, first)]
        sorties.append(
            Sortie(
                number=number, first=first, last=len(targets), start=start,
                time_s=outcome.time_s, energy_wh=outcome.energy_wh,
                boat=boats[number - 1] if boats else 1,
            )
        )  # fmt: skip
    survey = replace(
        parts[0],
        targets=tuple(targets),
        corridors=tuple(one for part in parts for one in part.corridors),
        outcome=_outcome(parts, bound_m),
    )
    return survey, first_revision(survey, sorties)


def _trip_draft(lake: Lake, harbour: int, order: Order) -> Draft:
    home = lake.homes[harbour]
    cell = lake.draft.cells[home.cell].footprint
    half = min(0.5 * HARBOUR_M, 0.25 * lake.draft.cell_m)
    north, east = home.place
    square = shapely.box(north - half, east - half, north + half, east + half)
    berth = shapely.intersection(cell, square)
    return replace(
        lake.draft,
        route=Route(order=order, legs_s=0.0, method="sorties"),
        start=home.place,
        harbour=berth if isinstance(berth, shapely.Polygon) else cell,
        home=home.cell,
    )


def _outcome(parts: Sequence[Survey], bound_m: float) -> PlanOutcome:
    each = [part.outcome for part in parts if part.outcome is not None]
    length = sum(one.length_m for one in each)
    return replace(
        each[0],
        length_m=length,
        turns=sum(one.turns for one in each),
        time_s=sum(one.time_s for one in each),
        energy_wh=sum(one.energy_wh for one in each),
        lower_bound_m=bound_m,
        gap=length / bound_m - 1 if bound_m > 0 else 0.0,
    )


def checked(survey: Survey, revision: PlanRevision, water: shapely.Polygon) -> PlanCheck:
    """The check of each sortie, put together: from one to the next nobody sails."""
    checks = [check_plan(survey_of(survey, revision, one), water) for one in revision.sorties]
    cells = survey.cells
    overlap = overlap_m2(cells)
    return PlanCheck(
        outside_m2=sum(one.outside_m2 for one in checks),
        coverage=covered_share(cells, water, overlap),
        overlap_m2=overlap,
        start_afloat=all(one.start_afloat for one in checks),
    )
