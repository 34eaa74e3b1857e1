"""A fleet that explores together, compared with boats that know less of each other.

Three boats share the waters of `benchmarks.adaptive`: a coarse pass of some minutes, then as long
again where it pays, sailed by the loop of `grebe run`. There are three ways to go on: each boat
plans by all measurements and the others' announcements; by all measurements; by its own
measurements. They are compared with one fixed plan of the whole time. Every map is made of all
samples. The standard deviations are those of a stationary water's own covariance, the same for all
plans.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from benchmarks.adaptive import (
    BOAT,
    FRAME,
    KEY,
    KINDS,
    LAKE,
    LENGTH_SCALE_M,
    NODES,
    NOISE,
    water_of_kind,
)  # fmt: skip
from benchmarks.common import print_head, print_row
from grebe.core.errors import PlanError
from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.quantities import LIMNOLOGICAL
from grebe.io.store import SurveyFile
from grebe.links.simulated import EXACT, SimulatedLink
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import Sonde
from grebe.workflow.adaptive import adapted
from grebe.workflow.adaptive_run import ROUNDS, SHORTEST_MINUTES, Onward
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.wish import Wish

NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
BOATS, APART_M = 3, 8.0
# The cells of the coarse pass take three boats some five and a half minutes; those of the one plan
# as long as the pass and the rounds.
COARSE_M, WHOLE_M, MINUTES = 32.0, 16.0, 5.0
# Readings of two boats within this distance are redundant [m].
SAME_M = 5.0
EACH = 2
# The remaining deviation is evaluated at this many places, from this many of the readings.
PLACES, READINGS = 1_200, 1_500
WAYS = ("together", "without announcements", "each by itself", "one plan of the whole time")


@dataclass(frozen=True)
class Score:
    way: str
    rmse: float
    half_sd: float
    sd: float
    again: float
    minutes: float
    least_m: float


@dataclass(kw_only=True)
class Apart:
    """Where a boat goes on that ignores the others' announcements and, if `by_itself`, also their
    measurements.
    """

    path: Path
    wish: Wish
    by_itself: bool
    began_s: float | None = None

    def __call__(self, revision, halfway, time_s):
        self.began_s = time_s if self.began_s is None else self.began_s
        left = self.wish.minutes - (time_s - self.began_s) / 60
        if left < SHORTEST_MINUTES and time_s > self.began_s:
            raise PlanError("the time is over")
        with SurveyFile.open(self.path) as file:
            survey, quantities, samples = file.survey, file.quantities, file.samples()
        if self.by_itself:
            samples = samples.rows(samples.boat == halfway.sortie.boat)
        round_ = min(left, max(self.wish.minutes / ROUNDS, SHORTEST_MINUTES))
        wish = replace(self.wish, minutes=round_)
        return adapted(survey, revision, samples, quantities, halfway, wish).revision


def sailed(path, water, seed, extends):
    """Sail a fleet; the minutes of the longest, and the least distance between true boats [m]."""
    plants, least = {}, [np.inf]

    def boat_at(boat, departure):
        plants[boat] = Plant(departure.vessel, departure.state)
        own = seed + 100 * boat
        return SimulatedLink(plants[boat], Sonde(water, own), EXACT, own, "benchmark")

    def look(_):
        places = np.array([plant.state[:2] for plant in plants.values()])
        if len(places) == BOATS:
            away = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
            least[0] = min(least[0], away[np.triu_indices(BOATS, 1)].min())

    with SurveyFile.open(path) as file:
        run = FleetRun(file, boat_at, steered_by(), watches=lambda _: [look], extends=extends)
        return run.run(NOON).duration_s / 60, least[0]


def read_again(samples, rounds_from):
    """The share of the rounds' readings that are beside those of another boat."""
    late, beside = 0, 0
    for boat in range(1, BOATS + 1):
        own = np.flatnonzero((samples.boat == boat) & (samples.times >= rounds_from))
        others = samples.positions[samples.boat != boat]
        late += len(own)
        beside += int(np.sum(KDTree(others).query(samples.positions[own])[0] < SAME_M))
    return beside / max(late, 1)


def one_water(job):
    """Sail one water by every plan."""
    kind, seed = job
    water = water_of_kind(kind, seed)
    region = Region(name="lake", frame=FRAME, water=LAKE)
    wish = Wish(quantity=KEY, minutes=MINUTES)
    scores = []
    with tempfile.TemporaryDirectory() as name:
        for way in WAYS:
            path = Path(name) / f"{way}.gpkg"
            whole = way == WAYS[-1]
            fleet = FleetSettings(boats=BOATS, apart_m=APART_M)
            wanted = PlanSettings(cell_m=WHOLE_M if whole else COARSE_M, core=0.3, fleet=fleet)
            planned = plan_fleet(region, BOAT, wanted)
            write_survey(path, planned.survey, revision=planned.revision)
            onward = {
                WAYS[0]: lambda sailing, at=path: Onward(path=at, wish=wish, sailing=sailing),
                WAYS[1]: lambda _, at=path: Apart(path=at, wish=wish, by_itself=False),
                WAYS[2]: lambda _, at=path: Apart(path=at, wish=wish, by_itself=True),
            }
            minutes, least_m = sailed(path, water, seed, onward.get(way))
            scores.append(scored(way, path, water, minutes, least_m))
    return kind, scores


def left_sd(positions):
    """The standard deviation that readings leave of a stationary water, as the root of the mean
    square over the lake, by the covariance that the waters were drawn with. No map knows that
    covariance.
    """
    nodes = make_grid(LAKE, float(np.sqrt(LAKE.area / PLACES))).nodes
    readings = positions[:: max(1, len(positions) // READINGS)]
    seen = matern(nodes, readings)
    system = matern(readings, readings) + NOISE**2 * np.eye(len(readings))
    gone = np.einsum("ij,ji->i", seen, np.linalg.solve(system, seen.T))
    return float(np.sqrt(np.mean(np.maximum(1.0 - gone, 0.0))))


def matern(one, other):
    """Covariance of smoothness 3/2 and variance 1."""
    scaled = np.sqrt(3.0) * cdist(one, other) / LENGTH_SCALE_M
    return (1.0 + scaled) * np.exp(-scaled)


def scored(way, path, water, minutes, least_m):
    """Compare the map of all samples with the truth."""
    with SurveyFile.open(path) as file:
        samples, events, adaptive = file.samples(), file.events(), len(file.revisions()) > 1
    grid = make_grid(LAKE, float(np.sqrt(LAKE.area / NODES)))
    made = Mapper(LAKE, grid).map_quantity(
        LIMNOLOGICAL[KEY], samples.positions, samples.values[KEY], samples.flags[KEY]
    )
    off = made.mean[grid.inside] - water.value(KEY, grid.nodes)
    first = next((e.time.timestamp() for e in events if e.code == "plan_revised"), np.nan)
    half = samples.positions[samples.times < first + 30 * MINUTES]
    return Score(
        way,
        rmse=float(np.sqrt(np.mean(off**2))),
        half_sd=left_sd(half) if adaptive else np.nan,
        sd=left_sd(samples.positions),
        again=read_again(samples, first) if adaptive else np.nan,
        minutes=minutes,
        least_m=float(least_m),
    )


def exploring(each: int = EACH) -> None:
    """Map error, remaining standard deviation, and readings made twice, by plan."""
    of = defaultdict(list)
    with Pool(2) as pool:
        jobs = [(kind, seed) for seed in range(each) for kind in KINDS]
        for kind, scores in pool.imap_unordered(one_water, jobs):
            for one in scores:
                of[one.way].append(one)
                print(kind, one, flush=True)
    print_head(
        f"{BOATS} boats that explore, {each * len(KINDS)} waters: mean of each",
        "plan", "minutes of the longest", "RMSE", "sd after half of the rounds", "sd at the end",
        "read beside another's", "least distance [m]",
    )  # fmt: skip
    for way in WAYS:
        ones = of[way]
        print_row(
            way,
            f"{np.mean([one.minutes for one in ones]):.1f}",
            f"{np.mean([one.rmse for one in ones]):.3f}",
            f"{np.mean([one.half_sd for one in ones]):.3f}",
            f"{np.mean([one.sd for one in ones]):.3f}",
            f"{100 * np.mean([one.again for one in ones]):.0f} %",
            f"{min(one.least_m for one in ones):.1f}",
        )
