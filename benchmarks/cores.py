"""What a survey's time buys: lanes, free orders, and targets drawn in to the cores of their cells.

Each plan is sailed. Samples are taken each second within the window. The map's standard deviation
follows from their places: a Matern-3/2 field of variance 1, nugget 0.05.
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial.distance import cdist

from benchmarks.common import print_head, print_row
from benchmarks.planning import BOAT, FRAME, lake
from grebe.control.controller import Controller
from grebe.core.plan_settings import PlanSettings
from grebe.mission.trial import Conditions, simulate
from grebe.planning.planner import plan
from grebe.planning.region import Region

RANGES_M = (5.0, 10.0, 20.0)
WAYS = {
    "rows": PlanSettings(pattern="rows"),
    "free": PlanSettings(),
    "core 0.75": PlanSettings(core=0.75),
    "core 0.5": PlanSettings(core=0.5),
    "core 0.3": PlanSettings(core=0.3),
    "free, cells of 4 m": PlanSettings(cell_m=4.0),
}


def cores() -> None:
    region = Region(name="lake", frame=FRAME, water=lake(400))
    ranges = ", ".join(f"{one:g}" for one in RANGES_M)
    print_head(
        f"Cells of 5 m, flown; mean standard deviation for range parameters of {ranges} m",
        "plan", "targets", "predicted s", "flown s", "samples", "standard deviation",
    )  # fmt: skip
    for name, settings in WAYS.items():
        planned = plan(region, BOAT, settings)
        survey = planned.survey
        pilot = Controller(BOAT, survey.sets, corridors=survey.corridors)
        flight = simulate(
            BOAT, survey.sets, pilot, survey.start.at_rest(), Conditions(limit_s=5_000)
        )
        assert flight.complete
        samples = flight.sampled
        spread = [_mean_sd(samples, region.water, one) for one in RANGES_M]
        print_row(
            name, len(survey.targets), f"{planned.outcome.time_s:.0f}",
            f"{flight.duration_s:.0f}", len(samples), " / ".join(f"{one:.3f}" for one in spread),
        )  # fmt: skip


def _mean_sd(samples: np.ndarray, water: shapely.Polygon, range_m: float) -> float:
    x0, y0, x1, y1 = water.bounds
    grid = np.stack(np.meshgrid(np.linspace(x0, x1, 50), np.linspace(y0, y1, 50)), axis=-1)
    places = grid.reshape(-1, 2)
    places = places[shapely.contains_xy(water, places)]

    def covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        h = np.sqrt(3) * cdist(a, b) / range_m
        return (1 + h) * np.exp(-h)

    known = covariance(samples, samples) + 0.05 * np.eye(len(samples))
    between = covariance(places, samples)
    left = 1 - np.sum(between * np.linalg.solve(known, between.T).T, axis=1)
    return float(np.sqrt(left.mean()))
