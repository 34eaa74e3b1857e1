"""Fleets in narrow water with one harbour: `python -m benchmarks.narrow`.

Two or three boats, mostly unlike, share waters of 10 to 25 m across: bent arms, ponds with a
channel between them, arms that branch. All have the same harbour and keep 8 m apart, so nowhere in
a channel can two of them turn beside each other. The output is the targets that are left, the
longest time of a boat, and the least distance between the true boats on the water.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely

from benchmarks.fleets import FRAME, NOON
from grebe.core.dynamics import Weather
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.simulated import EXACT, EstimateErrors
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

APART_M = 8.0
NOISE = EstimateErrors(position_m=0.2, heading_rad=0.02, velocity_mps=0.03)


def arm(width_m, length_m, bend_deg):
    """An arm with a bend in its middle."""
    half, angle = length_m / 2, math.radians(bend_deg)
    end = (half + half * math.cos(angle), half * math.sin(angle))
    return shapely.LineString([(0, 0), (half, 0), end]), width_m


def branching(width_m, length_m):
    """An arm with another that branches off in its middle."""
    half = length_m / 2
    ways = [[(0, 0), (length_m, 0)], [(half, 0), (half, half)]]
    return shapely.MultiLineString(ways), width_m


def ponds(width_m, length_m):
    """Two ponds of 60 m with a channel between them."""
    channel = shapely.LineString([(-25, 0), (length_m + 55, 0)])
    squares = [shapely.box(-30, -30, 30, 30), shapely.box(length_m, -30, length_m + 60, 30)]
    return channel, width_m, squares


@dataclass(frozen=True, kw_only=True)
class Case:
    """A water, its boats, the minutes of a sortie, the cells [m], where along the water the harbour
    is (0 to 1), and the world.
    """

    water: tuple
    boats: tuple[str, ...]
    minutes: float
    cell_m: float
    at: float
    current_mps: float = 0.0
    errors: EstimateErrors = EXACT
    seed: int = 0


CASES = (
    Case(water=arm(16, 250, 40), boats=("heron", "blueboat"), minutes=12, cell_m=8, at=0.5),
    Case(water=ponds(10, 100), boats=("blueboat", "heron"), minutes=10, cell_m=8, at=0.05),
    Case(water=arm(25, 250, 80), boats=("spyboat", "otter"), minutes=10, cell_m=8, at=0.02),
    Case(water=branching(16, 160), boats=("heron", "blueboat"), minutes=10, cell_m=8, at=0.02),
    Case(water=arm(14, 250, 40), boats=("blueboat", "heron"), minutes=8, cell_m=7, at=0.4),
    Case(water=branching(20, 160), boats=("blueboat", "otter"), minutes=8, cell_m=8, at=0.3,
         current_mps=0.15, errors=NOISE),
    Case(water=arm(20, 250, 40), boats=("heron", "spyboat"), minutes=8, cell_m=8, at=0.6,
         current_mps=0.15, errors=NOISE, seed=2),
    Case(water=ponds(14, 80), boats=("heron", "blueboat", "spyboat"), minutes=8, cell_m=8, at=0.5),
    Case(water=arm(16, 250, 40), boats=("blueboat", "heron"), minutes=8, cell_m=8, at=0.02,
         errors=NOISE, seed=3),
    Case(water=branching(14, 140), boats=("blueboat", "heron"), minutes=6, cell_m=7, at=0.5),
    Case(water=arm(12, 200, 60), boats=("heron", "spyboat"), minutes=6, cell_m=7, at=0.5, seed=4),
    Case(water=branching(15, 180), boats=("heron", "blueboat", "spyboat"), minutes=8, cell_m=8,
         at=0.4, seed=5),
)  # fmt: skip


def planned(case, path):
    """Write the case's plan."""
    line, width_m, *more = case.water
    water = line.buffer(width_m / 2, cap_style="square", join_style="mitre")
    water = shapely.union_all([water, *(more[0] if more else [])])
    if more:
        water = shapely.intersection(water, shapely.box(-30, -30, water.bounds[2], 30))
    ways = shapely.get_parts(line)
    place = ways[0].interpolate(case.at, normalized=True)
    harbour = FRAME.to_wgs84([(place.x, place.y)]).tolist()[0]
    vessels = tuple(PRESETS[name] for name in case.boats)
    wishes = PlanSettings(
        cell_m=case.cell_m,
        fleet=FleetSettings(boats=len(vessels), apart_m=APART_M, vessels=vessels),
        sorties=SortieSettings(minutes=case.minutes, harbours=(tuple(harbour),)),
    )
    made = plan_sorties(Region(name="narrow", frame=FRAME, water=water), vessels[0], wishes)
    write_survey(path, made.survey, revision=made.revision)


def sail(case, path):
    """Sail a case; its report, and the least distance of the boats that are on the water."""
    angle = np.random.default_rng(case.seed).uniform(0, 2 * np.pi)
    world = SimulatedWorld(
        weather=Weather(
            current_north_mps=case.current_mps * math.cos(angle),
            current_east_mps=case.current_mps * math.sin(angle),
        ),
        errors=case.errors,
        seed=case.seed,
    )
    plants, traffic, least = {}, {}, [math.inf]

    def boat_at(boat, departure):
        link = replace(world, boat=boat)(departure)
        plants[boat] = link._plant
        return link

    def look(_):
        afloat = [
            np.array(plant.state[:2])
            for boat, plant in plants.items()
            if boat in traffic and boat in traffic[boat]._claims
        ]
        for i, one in enumerate(afloat):
            for other in afloat[:i]:
                least[0] = min(least[0], float(np.hypot(*(one - other))))

    def ready(boat, mission):
        traffic[boat] = mission._lookout.traffic

    with SurveyFile.open(path) as file:
        run = FleetRun(file, boat_at, steered_by(), watches=lambda _: [look], on_ready=ready)
        report = run.run(NOON)
        codes = [event.code for event in file.events()]
    return report, least[0], codes


def main():
    left = targets = 0
    with tempfile.TemporaryDirectory() as name:
        for k, case in enumerate(CASES, 1):
            path = Path(name) / f"{k}.gpkg"
            planned(case, path)
            report, away, codes = sail(case, path)
            left += report.targets - report.reached
            targets += report.targets
            print(
                f"{k}: {' + '.join(case.boats)}, {case.water[1]} m: {report.targets} targets, "
                f"{report.targets - report.reached} left, {report.duration_s:.0f} s, least "
                f"{away:.2f} m, waited {codes.count('another_boat_near')} times",
                flush=True,
            )
    print(f"{len(CASES)} waters: {left} of {targets} targets left")


if __name__ == "__main__":
    main()
