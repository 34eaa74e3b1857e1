"""Fleets: `python -m benchmarks.fleets [--missions N]`.

First, the makespan of four boats over a quarter of one boat's time, as planned and as flown, on a
concave lake with islands. Second, the least distance between the true boats over random fleets:
squares of 40 to 60 m that two to four boats share from starts near each other, in a current, with
noise.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import shapely

from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.simulated import EstimateErrors
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld

FRAME = LocalFrame(origin_lon_deg=6.55, origin_lat_deg=46.45)
APART_M = 6.0
NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
LAKE = shapely.box(0, 0, 150, 150) - shapely.box(50, 60, 150, 90) - shapely.box(20, 110, 40, 125)


def sail(path, world):
    """Sail a fleet's file; its report and the least distance between the boats' true places."""
    plants, least = {}, [math.inf]

    def boat_at(boat, departure):
        link = replace(world, boat=boat)(departure)
        plants[boat] = link._plant
        return link

    def look(_):
        places = np.array([np.array(plant.state[:2]) for plant in plants.values()])
        away = np.hypot(*(places[:, None] - places[None]).T)
        least[0] = min(least[0], away[np.triu_indices(len(places), 1)].min())

    with SurveyFile.open(path) as file:
        report = FleetRun(file, boat_at, steered_by(), watches=lambda _: [look]).run(NOON)
    return report, least[0]


def makespan(folder):
    """Compare four boats with one."""
    region = Region(name="lake", frame=FRAME, water=LAKE)
    wishes = PlanSettings(cell_m=10.0)
    alone = plan(region, PRESETS["spyboat"], wishes).survey
    four = plan_fleet(region, PRESETS["spyboat"], replace(wishes, fleet=FleetSettings(boats=4)))
    write_survey(folder / "one.gpkg", alone)
    write_survey(folder / "four.gpkg", four.survey, revision=four.revision)
    with SurveyFile.open(folder / "one.gpkg") as file:
        one = run_survey(file, SimulatedWorld(), steered_by(), NOON)
    report, least = sail(folder / "four.gpkg", SimulatedWorld())
    sailed = report.duration_s / (one.duration_s / 4)
    print(
        f"makespan of 4 over a quarter of one boat's: planned {four.legs_s / four.bound_s:.3f}, "
        f"flown {sailed:.3f}; complete {report.complete}, least distance {least:.1f} m"
    )


def random_fleet(rng, path):
    """A square that several boats share from starts side by side."""
    side, boats = float(rng.uniform(40, 60)), int(rng.integers(2, 5))
    middle, gap = side / 2, APART_M + 4.0
    places = [(middle + gap * (k // 2) - gap / 2, middle + gap * (k % 2) - gap / 2)
              for k in range(boats)]  # fmt: skip
    starts = tuple((lon, lat) for lon, lat in FRAME.to_wgs84(places).tolist())
    region = Region(name="x", frame=FRAME, water=shapely.box(0, 0, side, side))
    fleet = FleetSettings(boats=boats, apart_m=APART_M, starts=starts)
    settings = PlanSettings(cell_m=float(rng.uniform(7, 12)), fleet=fleet)
    planned = plan_fleet(region, PRESETS["spyboat"], settings)
    write_survey(path, planned.survey, revision=planned.revision)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missions", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        makespan(folder)
        least, complete, waits = [], 0, 0
        for k in range(asked.missions):
            rng = np.random.default_rng([asked.seed, k])
            path = folder / f"{k}.gpkg"
            try:
                random_fleet(rng, path)
            except PlanError as error:
                print(f"{k}: {error}")
                continue
            angle, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.3)
            world = SimulatedWorld(
                weather=Weather(
                    current_north_mps=speed * np.cos(angle), current_east_mps=speed * np.sin(angle)
                ),
                errors=EstimateErrors(position_m=0.2, heading_rad=0.02, velocity_mps=0.03),
                seed=k,
            )
            report, away = sail(path, world)
            with SurveyFile.open(path) as file:
                waits += sum(event.code == "another_boat_near" for event in file.events())
            least.append(away)
            complete += report.complete
            print(f"{k}: {report.reached} of {report.targets}, least {away:.2f} m", flush=True)
    print(
        f"{len(least)} fleets: {complete} complete, least distance {min(least):.2f} m of "
        f"{APART_M:g} stated, {waits} times a boat waited"
    )


if __name__ == "__main__":
    main()
