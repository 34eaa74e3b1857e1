"""Adaptive surveys against fixed plans of equal time, on waters on which nothing was tuned.

Thirty waters of six hectares with a peninsula and an island: stationary, with a front, with
plumes. Each is sailed by the loop of `grebe run`: under fixed plans of several patterns, under the
plan for accuracy, and in two parts of half the time each with `grebe adapt` between them. Every
map is made from the samples as `grebe map` makes it, and compared with the true water.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from multiprocessing import Pool
from pathlib import Path

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from benchmarks.informative import informative_path, interpreter, sampled
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag
from grebe.core.taut import path_through
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.simulated import EXACT, SimulatedLink
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.planning.revisions.revise import Halfway
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import Sonde
from grebe.simulation.water import Water
from grebe.workflow.accuracy import plan_for_accuracy, prior_of_range
from grebe.workflow.adaptive import Wish, adapted
from grebe.workflow.files import write_survey
from grebe.workflow.run import run_survey, steered_by

BOAT = PRESETS["spyboat"]
FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
LAKE = shapely.box(0, 0, 260, 260) - shapely.box(90, 100, 260, 130) - shapely.box(40, 190, 70, 220)
NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
MINUTES, NODES, SIDE = 20.0, 2_500, 131
KEY, NOISE, RANGE_M = "temperature_degc", 0.1, 60.0
# Of the Matern covariance of smoothness 3/2, whose practical range is 2.74 of it.
LENGTH_SCALE_M = RANGE_M / 2.74
KINDS = ("stationary", "front", "plumes")
EACH = 10
# The target is the highest fifth of the water.
ABOVE = 0.8
FIXED = {
    "rows": {"pattern": "rows"},
    "rows, core 0.3": {"pattern": "rows", "core": 0.3},
    "free": {},
    "free, core 0.3": {"core": 0.3},
}


@dataclass(frozen=True)
class Score:
    way: str
    rmse: float
    f1: float
    minutes: float


def water_of_kind(kind: str, seed: int) -> Water:
    """A truth of variance about 1; with a front or plumes, half of it is not stationary."""
    import gstools as gs

    north = east = np.linspace(0, 260, SIDE)
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    model = gs.Matern(dim=2, var=1.0, len_scale=RANGE_M / 3.87, nu=1.5)
    base = np.asarray(gs.SRF(model, seed=int(rng.integers(2**31))).structured([north, east]))
    x, y = np.meshgrid(north, east, indexing="ij")
    if kind == "front":
        angle, bend = rng.uniform(0, 2 * np.pi), rng.uniform(-30, 30)
        across = np.cos(angle) * (x - 130) + np.sin(angle) * (y - 130)
        along = np.cos(angle) * (y - 130) - np.sin(angle) * (x - 130)
        base = 0.5 * base + 2.0 * np.tanh((across - bend * np.sin(along / 40)) / 6)
    if kind == "plumes":
        base = 0.5 * base
        for _ in range(int(rng.integers(1, 4))):
            at = rng.uniform(20, 240, 2)
            wide, long = rng.uniform(6, 14), rng.uniform(15, 40)
            angle = rng.uniform(0, np.pi)
            a = np.cos(angle) * (x - at[0]) + np.sin(angle) * (y - at[1])
            b = np.cos(angle) * (y - at[1]) - np.sin(angle) * (x - at[0])
            base += rng.uniform(3, 6) * np.exp(-0.5 * ((a / long) ** 2 + (b / wide) ** 2))
    return Water(north=north, east=east, fields={KEY: 15 + base}, noise_sd={KEY: NOISE})


def _sail(path: Path, water: Water, seed: int, *, resume: bool = False) -> float:
    """Sail the plan and return the minutes that it took."""

    def boat_at(departure) -> SimulatedLink:
        plant = Plant(departure.vessel, departure.state)
        return SimulatedLink(plant, Sonde(water, seed + resume), EXACT, seed, "benchmark")

    with SurveyFile.open(path) as file:
        now = NOON + timedelta(hours=1) if resume else NOON
        return run_survey(file, boat_at, steered_by(), now, resume=resume).duration_s / 60


def _go_on(path: Path, wish: Wish) -> None:
    """Do what `grebe adapt` does."""
    with SurveyFile.open(path) as file:
        ends = file.track_ends()
        assert ends is not None
        file.claim()
        place = ends[1].state[:2]
        found = adapted(
            file.survey, file.revision, file.samples(), file.quantities,
            Halfway(reached=file.progress().reached, place=(place[0], place[1])), wish,
        )  # fmt: skip
        file.append_revision(found.revision)


def _score(way: str, path: Path, water: Water, minutes: float) -> Score:
    with SurveyFile.open(path) as file:
        samples, region = file.samples(), file.survey.water
    readings = samples.positions, samples.values[KEY], samples.flags[KEY]
    return _score_of(way, readings, region, water, minutes)


def _score_of(
    way: str, readings: tuple[np.ndarray, ...], region: shapely.Polygon, water: Water,
    minutes: float,
) -> Score:  # fmt: skip
    grid = make_grid(region, float(np.sqrt(region.area / NODES)))
    made = Mapper(region, grid).map_quantity(LIMNOLOGICAL[KEY], *readings)
    real, mean = water.value(KEY, grid.nodes), made.mean[grid.inside]
    level = _level(water)
    hit = np.sum((mean > level) & (real > level))
    f1 = 2 * hit / max(np.sum(mean > level) + np.sum(real > level), 1)
    return Score(way, float(np.sqrt(np.mean((mean - real) ** 2))), float(f1), minutes)


def _level(water: Water) -> float:
    grid = make_grid(LAKE, float(np.sqrt(LAKE.area / NODES)))
    return float(np.quantile(water.value(KEY, grid.nodes), ABOVE))


def _one_water(job: tuple[str, int]) -> tuple[str, list[Score]]:
    kind, seed = job
    water = water_of_kind(kind, seed)
    region = Region(name="lake", frame=FRAME, water=LAKE)
    scores: list[Score] = []
    with tempfile.TemporaryDirectory() as name:

        def sailed(way: str, wishes: PlanSettings, then: Wish | None = None) -> None:
            path = Path(name) / f"{way}.gpkg"
            if way == "plan for accuracy":
                prior = prior_of_range(RANGE_M)
                planned = plan_for_accuracy(region, BOAT, wishes, prior).best.planned
            else:
                planned = plan(region, BOAT, wishes)
            write_survey(path, planned.survey)
            minutes = _sail(path, water, seed)
            if then is not None:
                _go_on(path, then)
                minutes += _sail(path, water, seed, resume=True)
            scores.append(_score(way, path, water, minutes))

        for way, pattern in FIXED.items():
            sailed(way, PlanSettings(cell_m=None, minutes=MINUTES, **pattern))
        sailed("plan for accuracy", PlanSettings(cell_m=None, minutes=MINUTES))
        for way, first, then, goal in (
            ("adapted, accuracy", 0.5, 0.5, "accuracy"),
            ("half the time: adapted, threshold", 0.4, 0.1, "threshold"),
        ):
            wish = Wish(
                quantity=KEY, minutes=then * MINUTES, goal=goal,
                threshold=_level(water) if goal == "threshold" else None,
            )  # fmt: skip
            sailed(way, PlanSettings(cell_m=None, minutes=first * MINUTES), wish)
        sailed("half the time: free", PlanSettings(cell_m=None, minutes=0.5 * MINUTES))
    if interpreter() is not None:
        scores.append(_informative(water, seed))
    return kind, scores


def _informative(water: Water, seed: int) -> Score:
    """A published planner's path, as long as the free order's, sailed by an ideal boat."""
    region = Region(name="lake", frame=FRAME, water=LAKE)
    free = plan(region, BOAT, PlanSettings(cell_m=None, minutes=MINUTES)).survey
    assert free.outcome is not None
    length = shapely.LineString(path_through(free)).length
    path = informative_path(LAKE, LENGTH_SCALE_M, NOISE, length)
    at = sampled(path, length / free.outcome.time_s)
    values = water.value(KEY, at) + np.random.default_rng(seed).normal(0.0, NOISE, len(at))
    flags = np.full(len(at), Flag.GOOD)
    return _score_of("sgptools, an ideal boat", (at, values, flags), LAKE, water, MINUTES)


def adaptive(each: int = EACH) -> None:
    """RMSE over that of the best fixed pattern, and F1 of the highest fifth, by kind of water."""
    rmse, f1, minutes = (defaultdict(list) for _ in range(3))
    with Pool(2) as pool:
        jobs = [(kind, seed) for seed in range(each) for kind in KINDS]
        for kind, scores in pool.imap_unordered(_one_water, jobs):
            for one in scores:
                rmse[one.way, kind].append(one.rmse)
                f1[one.way, kind].append(one.f1)
                minutes[one.way].append(one.minutes)
    best = {kind: min(FIXED, key=lambda way, kind=kind: np.mean(rmse[way, kind])) for kind in KINDS}
    print_head(
        f"Going where it pays: {3 * each} waters, RMSE over the best fixed pattern's / F1 of the "
        "highest fifth",
        "plan", "minutes flown", *KINDS,
    )  # fmt: skip
    for way in minutes:
        cells = [
            f"{np.mean(rmse[way, kind]) / np.mean(rmse[best[kind], kind]):.2f} / "
            f"{np.mean(f1[way, kind]):.2f}"
            for kind in KINDS
        ]
        print_row(way, f"{np.mean(minutes[way]):.1f}", *cells)
