"""Extend a survey where readings pay: plan the next revision from what was measured."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.stats import norm

from grebe.core.dynamics import CALM
from grebe.core.errors import InputError, PlanError
from grebe.core.revision import PlanRevision
from grebe.core.samples import Samples
from grebe.core.sets import TargetSet, drawn_in, footprints_of, polygons_of, rings_of
from grebe.core.survey import Survey, Target
from grebe.core.taut import taut_path
from grebe.mapping.fields.sequential import sequential
from grebe.mapping.grid import make_grid
from grebe.mapping.local_variation import local_variation
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.scale import LINEAR
from grebe.mapping.threads import one_blas_thread
from grebe.planning.cells.mesh import mesh_water, target_footprint
from grebe.planning.paths.place_paths import PlacePaths, place_paths
from grebe.planning.paths.travel import Travel, travel_of
from grebe.planning.region import water_of
from grebe.planning.revisions.adapt import Worth, chosen_places, once_read
from grebe.planning.revisions.revise import Halfway, OpenWater, put_in_order
from grebe.workflow.wish import Wish

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.core.quantities import Quantities

    Array = NDArray[np.floating]
    Ring = tuple[tuple[float, float], ...]

# About how many places can be visited; and the share of its cell to which a target is drawn in.
PLACES, CORE = 900, 0.6
# A cell that the shore cuts is not visited if its target is narrower than this [m] and less than
# half as wide as a complete one: boats circled slivers of a hand's breadth.
NARROWEST_M, NARROWEST_SHARE = 1.0, 0.5
# A route that uses this share of the time is accepted; otherwise the time is fitted in so many
# trials.
FULL, FITTINGS = 0.93, 5
# The sampler's interval [s]; and the share of the practical range beyond which readings on the way
# carry different information.
READING_EACH_S, APART_SHARE = 1.0, 0.5
# A hot spot is where values may exceed this quantile of the map.
HOT_SHARE = 0.95
# A threshold that is everywhere farther than this from the mean, in standard deviations, is not
# crossed.
NOWHERE_SD = 4.0


@dataclass(frozen=True, kw_only=True)
class Adapted:
    """The revision that extends a survey, and the standard deviation before and after.

    `before_sd` and `expected_sd` are the root mean square of the map's standard deviation before
    and as expected after, weighted by importance. The latter includes announcements of other boats.
    """

    revision: PlanRevision
    before_sd: float
    expected_sd: float
    places: int


def adapted(
    survey: Survey,
    revision: PlanRevision,
    samples: Samples,
    quantities: Quantities,
    halfway: Halfway,
    wish: Wish,
    *,
    announced: Sequence[Array] = (),
    closed: Sequence[shapely.Polygon] = (),
) -> Adapted:
    """Return where a survey, or its boat's sortie, goes on from halfway.

    `announced` are the paths (k, 2) along which other boats are going to read; this one reads
    elsewhere. It stays out of the `closed` areas. Raises `InputError` if the measurements yield no
    map, and `PlanError` if the time is too short for any place.
    """
    place, sortie = halfway.place, halfway.sortie
    settings, vessel = survey.settings, survey.vessel_of(sortie.boat if sortie else 1)
    if settings is None or vessel is None or survey.outcome is None:
        raise PlanError("Only a planned survey can be extended; plan it first.")
    if wish.quantity not in samples.values:
        raise InputError(f"The survey has no quantity {wish.quantity!r}.")
    open_ = _open_water(survey, revision.highest_seq)
    if closed:
        open_ = open_.closing(closed, place)
    if not open_.targets:
        raise PlanError("The water is nowhere wide enough for more places.")
    places = np.array([target.set.centre for target in open_.targets])
    window = (settings.speed_min_mps, settings.speed_max_mps)
    travel = travel_of(vessel, window, settings.weather)
    pace = 1 / float(np.mean(travel.slowness))
    worth = worth_of(survey, samples, quantities, places, wish, open_.cell_m / pace)
    paths = place_paths(places, open_.cell_m, open_.water)
    ahead = once_read(worth, paths, announced)
    route, left, sails_s = _best_route(ahead, paths, open_, travel, place, wish)
    before, after = (weighted_sd(one, worth.weights) for one in (np.diag(worth.covariance), left))
    # New paths around land are numbered after all the places that could be visited.
    known = max(target.seq for target in open_.targets)
    new = put_in_order(
        _numbered(revision, known),
        survey,
        open_,
        halfway,
        route,
        vessel=vessel,
        weather=settings.weather or CALM,
        reason="adaptive",
        note=f"{len(route)} more places for {wish.text}, in {sails_s / 60:.1f} minutes",
    )
    return Adapted(revision=new, before_sd=before, expected_sd=after, places=len(route))


def _best_route(
    worth: Worth,
    paths: PlacePaths,
    open_: OpenWater,
    travel: Travel,
    place: tuple[float, float],
    wish: Wish,
) -> tuple[list[int], Array, float]:
    """Return the places that reduce the weighted variance most in the time, in their order.

    Also returns the variances (n,) that they leave, and the predicted time [s]. Raises `PlanError`
    if no place is near enough.
    """
    pace = 1 / float(np.mean(travel.slowness))
    turn_m = travel.turn_s_per_rad * pace
    nearest = int(np.argmin(np.hypot(*(paths.places - np.array(place)).T)))
    route: list[int] = []
    sails_s = 0.0
    left, most_s, allowed_s = np.diag(worth.covariance), 60 * wish.minutes, 60 * wish.minutes
    for _ in range(FITTINGS):
        found, then = chosen_places(worth, paths, nearest, allowed_s, pace, turn_m)
        if not found:
            break
        takes_s = _predicted_s(open_, paths, travel, place, [nearest, *found])
        if takes_s <= most_s and len(found) >= len(route):
            route, left, sails_s = found, then, takes_s
        if FULL * most_s <= takes_s <= most_s:
            break
        allowed_s *= 0.5 * (1 + FULL) * most_s / max(takes_s, 1.0)
    if not route:
        raise PlanError(
            f"No place worth a reading is within {wish.minutes:g} minutes; give more.",
            settings=("minutes",),
        )
    return route, left, sails_s


def _predicted_s(
    open_: OpenWater,
    paths: PlacePaths,
    travel: Travel,
    place: tuple[float, float],
    tour: list[int],
) -> float:
    """Return the predicted time [s] of the path through some places: taut, and around land."""
    taut = taut_path(place, footprints_of([open_.targets[one].set for one in tour[1:]]))
    straight = np.hypot(*np.diff(paths.places[tour], axis=0).T)
    around_m = float((paths.lengths_m[tour[:-1], tour[1:]] - straight).sum())
    return travel.path_s(taut) + around_m * float(np.mean(travel.slowness))


def _numbered(revision: PlanRevision, known: int) -> PlanRevision:
    return replace(revision, highest_seq=max(known, revision.highest_seq))


def _open_water(survey: Survey, highest_seq: int) -> OpenWater:
    """Return places all over the water, each a small target with a number of its own.

    Those that are too narrow to be hit are left out.
    """
    assert survey.settings is not None
    water = water_of(survey)
    cell_m = math.sqrt(water.area / PLACES)
    cells = mesh_water(water, cell_m)
    rings = [target_footprint(ring) for ring in rings_of([cell.footprint for cell in cells])]
    drawn, wide = cores_of(rings, cell_m)
    kept = list(zip(itertools.compress(drawn, wide), polygons_of(rings)[wide], strict=True))
    targets = tuple(
        Target(
            seq=highest_seq + i,
            kind="cell",
            set=TargetSet(
                vertices=ring,
                speed_min_mps=survey.settings.speed_min_mps,
                speed_max_mps=survey.settings.speed_max_mps,
            ),
            cell=cell,
        )
        for i, (ring, cell) in enumerate(kept, 1)
    )
    return OpenWater(water=water, targets=targets, cell_m=cell_m)


def cores_of(rings: Sequence[Ring], cell_m: float) -> tuple[list[Ring], NDArray[np.bool_]]:
    """Return the core of each cell ring, which must be hit, and whether it is wide enough."""
    drawn = [drawn_in(ring, CORE) for ring in rings]
    narrowest_m = min(NARROWEST_M, NARROWEST_SHARE * CORE * cell_m)
    return drawn, ~shapely.is_empty(shapely.buffer(polygons_of(drawn), -0.5 * narrowest_m))


def worth_of(
    survey: Survey,
    samples: Samples,
    quantities: Quantities,
    places: Array,
    wish: Wish,
    pass_s: float,
) -> Worth:
    """Return the worth of places (m, 2), by the map of the measurements so far.

    Passing one takes `pass_s` [s]. Raises `InputError` if the measurements yield no map, and
    `PlanError` if the quantity crosses the threshold nowhere.
    """
    key = wish.quantity
    grid = make_grid(survey.water, math.sqrt(survey.water.area / PLACES))
    mapped = Mapper(survey.water, grid, MapSettings(scale=LINEAR)).map_quantity(
        quantities.known(key), samples.positions, samples.values[key], samples.flags[key]
    )
    with one_blas_thread():
        field = sequential(mapped.field, places)
    if field is None:
        raise InputError(
            f"{key} does not vary from place to place, or is mapped by a method that cannot say "
            "what more readings are worth."
        )
    mean, covariance = field.mean(places), field.covariance(places)
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    cell_m = math.sqrt(survey.water.area / PLACES)
    weights = _variation(mapped, places, survey.water.area, cell_m)
    if wish.goal == "threshold":
        assert wish.threshold is not None
        away = np.abs(wish.threshold - mean) / sd
        if away.min() > NOWHERE_SD:
            raise PlanError(
                f"The measured {key} is between {mean.min():.4g} and {mean.max():.4g} and "
                f"nowhere crosses {wish.threshold:g}; give another threshold.",
                settings=("threshold",),
            )
        # The density of the water's value at the threshold (Picheny et al. 2010, J. Mech. Des. 132,
        # on designs for a target region).
        weights = norm.pdf(away) / sd
    elif wish.goal == "hot-spot":
        weights = norm.sf((np.quantile(mean, HOT_SHARE) - mean) / sd)
    weights = np.maximum(weights / max(float(weights.sum()), 1e-300), 1e-9)
    range_m = mapped.model.practical_range_m or 0.0
    return Worth(
        places=places,
        covariance=covariance,
        noise=mapped.model.nugget / max(pass_s / READING_EACH_S, 1.0),
        weights=weights,
        apart_m=max(cell_m, APART_SHARE * range_m),
    )


def _variation(mapped: QuantityMap, places: Array, area_m2: float, cell_m: float) -> Array:
    """Return how much the water varies around each place.

    The scale is about the distance between two passes. It is estimated from readings that are at
    most two cells apart.
    """
    positions = mapped.positions
    passed = len(np.unique(np.floor(positions / cell_m), axis=0))
    between_m = area_m2 / max(passed * cell_m, 1.0)
    return local_variation(places, positions, mapped.values, 2 * cell_m, max(between_m, cell_m))


def weighted_sd(variance: Array, weights: Array) -> float:
    """Return the root of the weighted mean of variances (m,)."""
    return math.sqrt(float(weights @ variance / weights.sum()))
