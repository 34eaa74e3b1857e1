"""Cut a survey into sorties: trips from a harbour and back, each as long as a battery lasts.

The cells are put in the order in which a walk around the tree of shortest ways from the harbour
meets them, so that a stretch of that order is a wedge of the lake with its tip at the harbour.
Each wedge is made a round trip, and `grebe.planning.trips` then exchanges cells between them. The
fewest sorties that hold all cells are taken. A sortie is as long as lets the boat come home from
each of its places in the worst of the weather that was stated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.errors import PlanError, UsageError
from grebe.core.plan_settings import PlanOutcome, PlanSettings
from grebe.core.revision import PlanRevision, Sortie, first_revision, survey_of
from grebe.core.survey import Survey, Target, covered_share, overlap_m2
from grebe.core.vessel import Vessel
from grebe.planning.check import PlanCheck, check_plan
from grebe.planning.corridors import Waterways
from grebe.planning.costs import Costs, costs_of
from grebe.planning.planner import Draft, Planned, Planner, planner_of
from grebe.planning.polish import polished
from grebe.planning.region import Region
from grebe.planning.route import Route
from grebe.planning.taut import taut_way
from grebe.planning.travel import WANDER, Travel, ground_speed
from grebe.planning.trips import Ports, comes_home, improved_trips, trip_s
from grebe.planning.ways_home import WaysHome, around_the_tree, ways_home

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]

# A way home is reckoned longer by this share, and by so much: as the mission's guard does.
HOME_SHARE, HOME_SLACK_S = 0.25, 30.0
# A flown sortie may take so much longer than predicted before the guard calls the boat home.
MARGIN = 1.08
# Rounds of the exchange between trips, for each cell and at most.
ROUNDS_EACH, MOST_ROUNDS = 100, 400_000
# The share of the rounds that tells whether a number of trips can hold all cells, and the share of
# the cells that may be left then.
TRIAL_SHARE, MOST_ABSENT_SHARE = 0.15, 0.01
# Kicks of the polish of one trip.
KICKS = 3_000
# Cells that are looked at when a cell looks for a place.
BESIDE = 12
# A harbour's last target: a square of so many metres about it, or half of a smaller cell.
HARBOUR_M = 6.0
LEAST_MPS = 0.05
MOST_SORTIES = 200
FITTINGS = 5


@dataclass(frozen=True, kw_only=True)
class PlannedSorties(Planned):
    """A survey in sorties; `revision` holds them, `bound_s` is what no sorties together go below,
    `legs_s` what the trips through the cells' centres take in the same measure. Of a fleet without
    sorties `legs_s` is what the slowest boat takes, `bound_s` one boat's time over their number.
    """

    revision: PlanRevision
    bound_s: float
    legs_s: float


@dataclass(frozen=True, kw_only=True)
class Endurance:
    """How long a sortie may be [s], and by how much a second of the way home counts more than one
    of the survey: the way home may be against the weather, at a higher power.
    """

    limit_s: float
    homeward: float
    slowest: float

    def home_s(self, way_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """What must be left of a sortie for a way home of so many metres [s]."""
        worst = WANDER * self.slowest * way_m
        return (1 + HOME_SHARE) * self.homeward * worst + HOME_SLACK_S


def endurance_of(vessel: Vessel, settings: PlanSettings, travel: Travel) -> Endurance:
    """Return how far a boat may go; `PlanError` where the stated weather lets nobody home.

    The worst of the weather is a current and a wind as strong as stated, straight against the
    boat, whichever way it goes.
    """
    sorties = settings.sorties
    if sorties is None:
        raise UsageError("The plan has no settings of sorties.")
    weather = settings.weather
    current = math.hypot(weather.current_north_mps, weather.current_east_mps)
    wind = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    against = Weather(current_north_mps=-current, wind_force_north_n=-wind)
    worst = ground_speed(vessel, settings.speed_max_mps, against, 0.0)
    if worst < LEAST_MPS:
        raise PlanError(
            f"Against a current of {current:g} m/s and a wind of {wind:g} N vessel "
            f"{vessel.name!r} does not come home; wait for better weather."
        )
    through = min(settings.speed_max_mps + current, vessel.speed_max_mps)
    each = 0.5 * vessel.surge_drag_n(through)
    power = drive_power_w(vessel, (each, each), through)
    limits = [(60 * sorties.minutes, 1.0)] if sorties.minutes is not None else []
    if sorties.battery_wh is not None:
        lasts_s = 3600 * sorties.battery_wh / travel.power_w
        limits.append((lasts_s, max(1.0, power / travel.power_w)))
    limit_s = (1 - sorties.reserve) * min(one for one, _ in limits) / MARGIN
    homeward = max(factor for _, factor in limits)
    return Endurance(limit_s=limit_s, homeward=homeward, slowest=1 / worst)


def plan_sorties(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[shapely.Polygon] = (),
) -> PlannedSorties:
    """Plan a survey of a region in sorties; `PlanError` says why there is none.

    Without a harbour the sorties begin and end at the start.
    """
    sorties = settings.sorties
    if sorties is None:
        raise UsageError("What bounds a sortie is not given.", settings=("sortie_minutes",))
    start = start_lonlat or (sorties.harbours[0] if sorties.harbours else None)
    planner, notes = planner_of(region, vessel, settings, start, no_go)
    draft = planner.first_draft(quick=True)
    places = [region.frame.place_near(region.water, one, "harbour") for one in sorties.harbours]
    lake = lake_of(planner, draft, places or [draft.start])
    trips = trips_within(lake, endurance_of(vessel, settings, planner.travel))
    planned = _laid_out(lake, trips, notes)
    return planned if settings.fleet is None else dealt(planned, settings.fleet.boats)


@dataclass(frozen=True, kw_only=True)
class Lake:
    """A meshed lake with the ways to its harbours, and what its legs cost."""

    planner: Planner
    draft: Draft
    ways: Waterways
    homes: tuple[WaysHome, ...]
    costs: Costs
    wanted: NDArray[np.bool_]

    @property
    def travel(self) -> Travel:
        """What ways cost the boat."""
        return self.planner.travel

    @property
    def pitch_s(self) -> float:
        """Time from a cell to the next, or so."""
        return self.draft.cell_m * float(np.mean(self.travel.slowness))

    def seconds(self, outwards: bool) -> NDArray[np.float64]:
        """Time of the ways from the harbours to the cells, or back, (h, n): as long as they are,
        by the direction from the one to the other.
        """
        sign = 1.0 if outwards else -1.0
        rows: list[NDArray[np.float64]] = []
        for home in self.homes:
            way = sign * (self.draft.network.centres - np.array(home.place))
            straight = np.maximum(np.hypot(*way.T), 1e-9)
            rows.append(home.ways_m * self.travel.leg_s(way) / straight)
        return np.array(rows)


@dataclass(frozen=True, kw_only=True)
class Trips:
    """Orders of cells, the harbour of each by its number, and what they take by their legs
    through the cells' centres [s]; `bound_s` is below what any trips take in that measure.
    """

    orders: tuple[Order, ...]
    harbours: NDArray[np.int64]
    legs_s: float
    bound_s: float
    limit_s: float


def lake_of(planner: Planner, draft: Draft, places: Sequence[tuple[float, float]]) -> Lake:
    """Measure the ways from each place to the cells; it is moved into the nearest cell."""
    cells, network = draft.cells, draft.network
    shapes = np.array([cell.footprint for cell in cells], dtype=object)
    homes: list[WaysHome] = []
    for place in places:
        point = shapely.Point(place)
        cell = int(np.argmin(shapely.distance(shapes, point)))
        inner = shapes[cell].buffer(-0.1)
        inside = inner if not inner.is_empty else shapely.centroid(shapes[cell])
        north, east = shapely.get_coordinates(shapely.shortest_line(inside, point))[0].tolist()
        homes.append(ways_home(network, planner.water, (north, east), cell))
    return Lake(
        planner=planner,
        draft=draft,
        ways=Waterways(cells, network, planner.water, draft.cell_m),
        homes=tuple(homes),
        costs=costs_of(network, planner.travel, homes[0].place, returns=True),
        wanted=np.array([not cell.is_speck for cell in cells]),
    )


def trips_within(lake: Lake, endurance: Endurance, rounds: int | None = None) -> Trips:
    """Return the fewest trips that hold all cells, each within the endurance as it is predicted
    to be sailed. `rounds` of the exchange between them (None: by the number of cells).
    """
    count = int(lake.wanted.sum())
    rounds = min(ROUNDS_EACH * count, MOST_ROUNDS) if rounds is None else rounds
    # How much longer a trip takes than its legs through the centres: turns, and corners cut.
    factor, trips, best = _first_factor(lake), None, None
    for _ in range(FITTINGS):
        ports = ports_of(lake, endurance, factor)
        _refuse_unreachable(lake, ports)
        trips = _fewest(lake, ports, rounds, trips)
        seconds = _predicted_s(lake, trips)
        longest = float(seconds.max()) / (endurance.limit_s - HOME_SLACK_S)
        if longest <= 1:
            best = trips if best is None or len(trips.orders) < len(best.orders) else best
            if len(best.orders) <= math.ceil(seconds.sum() / endurance.limit_s):
                return best
        elif best is not None:
            return best
        factor *= 1.005 * longest
    if best is None:
        raise PlanError("No sorties were found whose predicted times keep the limit: a fault.")
    return best


def _first_factor(lake: Lake) -> float:
    """What one way through all cells is predicted to take, over its legs through the centres."""
    order = lake.draft.route.order
    footprints = np.array([cell.footprint for cell in lake.draft.cells], dtype=object)[order]
    centres = lake.draft.network.centres[order]
    if len(order) < 2:
        return WANDER
    north, east = centres[0].tolist()
    legs_s = float(lake.travel.leg_s(np.diff(centres, axis=0)).sum())
    return lake.travel.path_s(taut_way((north, east), footprints)) / legs_s


def ports_of(lake: Lake, endurance: Endurance, factor: float) -> Ports:
    """Gather what the exchange reads, where a trip takes `factor` times its legs' time."""
    centres = lake.draft.network.centres
    members = np.flatnonzero(lake.wanted)
    many = min(BESIDE + 1, len(members))
    beside = np.full((len(centres), BESIDE), -1)
    if many > 1:
        from scipy.spatial import KDTree

        near = KDTree(centres[members]).query(centres[members], k=many)[1]
        beside[members, : many - 1] = members[np.asarray(near)[:, 1:]]
    else:
        beside[members, 0] = members
    ways_m = np.array([home.ways_m for home in lake.homes])
    return Ports(
        out=lake.seconds(outwards=True),
        back=lake.seconds(outwards=False),
        home=endurance.home_s(ways_m) / factor,
        beside=beside,
        limit_s=(endurance.limit_s - HOME_SLACK_S) / factor,
        pitch_s=lake.pitch_s,
    )


def bound_s(lake: Lake, ports: Ports, trips: int = 1) -> float:
    """Return what no such trips through the centres of all cells go below together [s].

    Each cell has a leg to it and one from it, no shorter than its two shortest; each trip has
    two at its harbour.
    """
    out, back = ports.out.min(axis=0), ports.back.min(axis=0)
    legs = np.column_stack([lake.costs.nearest_s[:, :2], np.minimum(out, back)])[lake.wanted]
    least = np.sort(legs, axis=1)[:, :2].sum()
    at_harbours = trips * (out[lake.wanted].min() + back[lake.wanted].min())
    return 0.5 * float(least + at_harbours)


def _refuse_unreachable(lake: Lake, ports: Ports) -> None:
    best = np.min(ports.out + np.maximum(ports.home, ports.back), axis=0)[lake.wanted]
    if best.max() > ports.limit_s:
        away = np.min([home.ways_m for home in lake.homes], axis=0)[lake.wanted].max()
        raise PlanError(
            f"The cell farthest from a harbour is {away:.0f} m away along the water, and no sortie "
            "comes home from there within its battery or its minutes; give more of them, or "
            "another harbour nearby.",
            settings=("sortie_battery_wh", "sortie_minutes", "harbours"),
        )


def _fewest(lake: Lake, ports: Ports, rounds: int, before: Trips | None) -> Trips:
    """The best trips of the smallest number that hold all cells."""
    fewest = math.ceil(bound_s(lake, ports) / ports.limit_s)
    for count in range(fewest, MOST_SORTIES + 1):
        known = before is not None and len(before.orders) == count
        if known and before is not None:
            orders, harbours = list(before.orders), before.harbours
        else:
            orders, harbours = _wedges(lake, ports, count)
        trimmed = [
            _trimmed(lake, ports, int(h), order) for h, order in zip(harbours, orders, strict=True)
        ]
        # A first, short exchange tells whether so many trips may do at all.
        tried = max(1, int(TRIAL_SHARE * rounds))
        found, absent = improved_trips(lake.costs, ports, trimmed, harbours, tried)
        if len(absent) > MOST_ABSENT_SHARE * lake.wanted.sum():
            continue
        found, absent = improved_trips(lake.costs, ports, found, harbours, rounds)
        if len(absent) == 0:
            kept = [i for i, order in enumerate(found) if len(order)]
            return _trips(lake, ports, [found[i] for i in kept], harbours[kept])
    raise PlanError(
        f"More than {MOST_SORTIES} sorties would be needed; give them more time or larger cells.",
        settings=("sortie_battery_wh", "sortie_minutes", "cell_m"),
    )


def _trips(lake: Lake, ports: Ports, orders: list[Order], harbours: NDArray[np.int64]) -> Trips:
    seconds = [
        trip_s(lake.costs, ports, int(h), order, len(order))
        for h, order in zip(harbours, orders, strict=True)
    ]
    return Trips(
        orders=tuple(orders),
        harbours=harbours,
        legs_s=float(sum(seconds)),
        bound_s=bound_s(lake, ports, len(orders)),
        limit_s=ports.limit_s,
    )


def _wedges(lake: Lake, ports: Ports, count: int) -> tuple[list[Order], NDArray[np.int64]]:
    """So many trips: wedges of the water around each harbour, of equal numbers of cells."""
    nearest = np.argmin(ports.out, axis=0)
    members = [lake.wanted & (nearest == h) for h in range(len(lake.homes))]
    sizes = np.array([one.sum() for one in members])
    orders: list[Order] = []
    harbours: list[int] = []
    for h, parts in enumerate(_shared(sizes, count)):
        walk = around_the_tree(lake.draft.network, lake.homes[h], members[h])
        costs = costs_of(lake.draft.network, lake.travel, lake.homes[h].place, returns=True)
        for part in np.array_split(np.array(walk, dtype=np.int64), parts) if parts else []:
            orders.append(polished(costs, part, KICKS)[0] if len(part) > 1 else part)
            harbours.append(h)
    return orders, np.array(harbours, dtype=np.int64)


def _shared(sizes: NDArray[np.int64], count: int) -> list[int]:
    """Share `count` trips out by the numbers of cells, the largest remainders first."""
    exact = count * sizes / sizes.sum()
    parts = np.floor(exact).astype(int)
    for h in np.argsort(parts - exact)[: count - parts.sum()]:
        parts[h] += 1
    return parts.tolist()


def _trimmed(lake: Lake, ports: Ports, harbour: int, order: Order) -> Order:
    """The longest beginning of an order that is a trip within the limit."""
    low, high = 0, len(order)
    while low < high:
        middle = (low + high + 1) // 2
        if comes_home(lake.costs, ports, harbour, order, middle):
            low = middle
        else:
            high = middle - 1
    return order[:low].copy()


def _predicted_s(lake: Lake, trips: Trips) -> NDArray[np.float64]:
    """What each trip is predicted to take [s]."""
    found: list[float] = []
    for harbour, order in zip(trips.harbours.tolist(), trips.orders, strict=True):
        footprints = [stop.footprint for stop in lake.ways.stops(order)]
        way = taut_way(lake.homes[harbour].place, footprints)
        home_m = float(lake.homes[harbour].ways_m[order[-1]])
        back_s = WANDER * home_m * float(np.mean(lake.travel.slowness))
        found.append(lake.travel.path_s(way) + back_s)
    return np.array(found)


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
    """Deal sorties out to boats, the longest first, each to the boat that has least to do."""
    load = [0.0] * boats
    of: dict[int, int] = {}
    for one in sorted(planned.revision.sorties, key=lambda one: -one.time_s):
        boat = load.index(min(load))
        load[boat] += one.time_s
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
