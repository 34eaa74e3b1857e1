"""Test the paper's claim: whether a planned survey gives a better map than one driven by hand.

For each seed, water is simulated that agrees with the samples of a real hand-driven track. It is
sampled along that track and along a survey that Grebe plans and sails. Both maps are made in the
same way and compared with the truth. There are two plans: one of the same duration as the
hand-driven survey, and one of the same length, which removes the effect of the boat's higher speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.control.controller import Controller
from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.core.quantities import LIMNOLOGICAL, Quantity
from grebe.core.samples import Flag
from grebe.core.survey import Survey
from grebe.core.vessel import vessel_named
from grebe.mapping.grid import Grid, make_grid
from grebe.mapping.maps import Mapper
from grebe.mapping.proof.validation import Z95
from grebe.mission.trial import Conditions, simulate
from grebe.paper.hand_driven import HandDriven
from grebe.planning.planner import plan
from grebe.simulation.water import Water, conditioned_water

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

SEEDS = 30
NODES = 2_500
# Every cell is measured near its middle.
CORE = 0.5
WINDOW = (1.0, 2.0)
# A place counts as badly known if the map's sd exceeds this share of the truth's own sd.
SD_BOUND_SHARE = 0.5
# For the plan of equal length, cell sizes are tried, each scaled by the ratio of the last path's
# length to the wanted one, until the path is shorter by less than this share.
TRIALS, LENGTH_TOLERANCE = 7, 0.05


@dataclass(frozen=True, kw_only=True)
class Score:
    """The comparison of one map of one water with the truth, in the unit of the quantity.

    `method` names how the water was sampled. `unsure` is the share of the region whose sd is above
    `SD_BOUND_SHARE` of the truth's sd; `coverage95` is the share of the region where the truth is
    within the 95 % interval.
    """

    method: str
    quantity: str
    seed: int
    rmse: float
    largest: float
    unsure: float
    coverage95: float


@dataclass(frozen=True, kw_only=True)
class Sampled:
    """One way of sampling the region: places (n, 2) [m], path length and duration."""

    method: str
    positions: Array
    length_m: float
    duration_s: float


def samplings(hand: HandDriven, *, same_length: bool = True) -> list[Sampled]:
    """Return the hand-driven track, and the planned surveys of equal duration and of equal length.
    The latter takes several simulated surveys to find.
    """
    driven = Sampled(
        method="by hand",
        positions=hand.positions,
        length_m=hand.length_m,
        duration_s=hand.duration_s,
    )
    minutes = hand.duration_s / 60
    timed = plan(
        hand.region, vessel_named("spyboat"),
        PlanSettings(cell_m=None, minutes=minutes, core=CORE, speed_min_mps=WINDOW[0],
                     speed_max_mps=WINDOW[1]),
    ).survey  # fmt: skip
    found = [driven, sailed(timed, "planned, same duration")]
    return [*found, _as_long(hand, "planned, same length")] if same_length else found


def _as_long(hand: HandDriven, method: str) -> Sampled:
    """The planned survey whose track is about as long as the hand-driven one, and not longer."""
    cell_m = hand.survey.water.area / hand.length_m
    best: Sampled | None = None
    for _ in range(TRIALS):
        survey = plan(
            hand.region, vessel_named("spyboat"), PlanSettings(cell_m=cell_m, core=CORE)
        ).survey
        sampled = sailed(survey, method)
        share = sampled.length_m / hand.length_m
        if share <= 1 and (best is None or sampled.length_m > best.length_m):
            best = sampled
        if 1 - LENGTH_TOLERANCE < share <= 1:
            break
        cell_m *= share / (1 - 0.5 * LENGTH_TOLERANCE)
    if best is None:
        raise PlanError("No plan of this water is as short as the hand-driven track.")
    return best


def sailed(survey: Survey, method: str) -> Sampled:
    """Sail a survey in simulation, sampled by the default of all missions."""
    assert survey.vessel is not None
    assert survey.start is not None
    pilot = Controller(survey.vessel, survey.sets, corridors=survey.corridors)
    trial = simulate(
        survey.vessel, survey.sets, pilot, survey.start.at_rest(), Conditions(limit_s=20_000)
    )
    sampled = trial.sampled
    return Sampled(
        method=method,
        positions=sampled[shapely.intersects_xy(survey.water, sampled)],
        length_m=trial.report.path_m,
        duration_s=trial.duration_s,
    )


def measure(
    hand: HandDriven,
    sampled: list[Sampled],
    seeds: int = SEEDS,
    watch: Callable[[int, int], None] | None = None,
) -> Iterator[Score]:
    """Yield the score of each way of sampling, for each quantity and seed."""
    water = hand.survey.water
    grid = make_grid(water, float(np.sqrt(water.area / NODES)))
    mapper = Mapper(water, grid)
    for seed in range(1, seeds + 1):
        truth = conditioned_water(water.bounds, hand.positions, hand.good, seed)
        for quantity in LIMNOLOGICAL.values():
            if quantity.key not in truth.fields:
                continue
            for one in sampled:
                yield _score(mapper, grid, truth, quantity, one, seed)
        if watch is not None:
            watch(seed, seeds)


def _score(
    mapper: Mapper, grid: Grid, truth: Water, quantity: Quantity, sampled: Sampled, seed: int
) -> Score:
    rng = np.random.default_rng([seed, len(sampled.positions)])
    key = quantity.key
    noise = rng.normal(0.0, truth.noise_sd[key], len(sampled.positions))
    values = truth.value(key, sampled.positions) + noise
    flags = np.full(len(values), Flag.GOOD)
    made = mapper.map_quantity(quantity, sampled.positions, values, flags)
    real = truth.value(key, grid.nodes)
    error, sd = made.mean[grid.inside] - real, made.sd[grid.inside]
    return Score(
        method=sampled.method,
        quantity=key,
        seed=seed,
        rmse=float(np.sqrt(np.mean(error**2))),
        largest=float(np.max(np.abs(error))),
        unsure=float(np.mean(sd > SD_BOUND_SHARE * float(np.std(real)))),
        coverage95=float(np.mean(np.abs(error) <= Z95 * sd)),
    )


def summary(scores: list[Score]) -> list[dict[str, float | str]]:
    """Return means over the seeds for each quantity and way of sampling, and the share of the seeds
    in which its RMSE is below that of the hand-driven track.
    """
    rows: list[dict[str, float | str]] = []
    names = list(dict.fromkeys(score.method for score in scores))
    for key in dict.fromkeys(score.quantity for score in scores):
        base = {s.seed: s.rmse for s in scores if s.quantity == key and s.method == names[0]}
        for method in names:
            mine = [s for s in scores if s.quantity == key and s.method == method]
            rows.append(
                {
                    "quantity": key,
                    "way": method,
                    "rmse": float(np.mean([s.rmse for s in mine])),
                    "largest": float(np.mean([s.largest for s in mine])),
                    "unsure": float(np.mean([s.unsure for s in mine])),
                    "coverage95": float(np.mean([s.coverage95 for s in mine])),
                    "better_share": float(np.mean([s.rmse < base[s.seed] for s in mine])),
                }
            )
    return rows
