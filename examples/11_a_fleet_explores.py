"""
11. A fleet that explores together
==================================

Three boats share a lake, sail at the same time, keep apart, and fill one survey file.
"""

import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import shapely

import grebe
from grebe.core.events import Estimate
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings
from grebe.core.vessel import PRESETS
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun

frame = LocalFrame(origin_lon_deg=6.55, origin_lat_deg=46.45)
water = shapely.box(0, 0, 50, 60) - shapely.box(20, 25, 35, 35)
lake = Region(name="a lake with an island", frame=frame, water=water)
settings = grebe.PlanSettings(cell_m=10, fleet=FleetSettings(boats=3, apart_m=6))
planned = plan_fleet(lake, PRESETS["spyboat"], settings)
print("predicted [s]:", [round(part.time_s) for part in planned.revision.sorties])

# %%
# Each boat has its own controller and its own estimate. It claims the water that it could reach
# before it stops, and waits if its claim would come too near to another boat's.

path = Path(tempfile.mkdtemp()) / "fleet.gpkg"
write_survey(path, planned.survey, revision=planned.revision)
weather = grebe.Weather(current_north_mps=0.1, current_east_mps=0.1)
world = grebe.SimulatedWorld(weather=weather, errors=grebe.EstimateErrors(velocity_mps=0.02))
ways = {1: [], 2: [], 3: []}


def keep_way(boat):
    def hear(event):
        if isinstance(event, Estimate):
            ways[boat].append(event.state[:2])

    return [hear]


with grebe.SurveyFile.open(path) as file:
    run = FleetRun(
        file,
        lambda boat, departure: replace(world, boat=boat)(departure),
        grebe.steered_by(),
        watches=keep_way,
    )
    report = run.run(datetime(2026, 5, 1, 12, tzinfo=UTC))
print(f"{report.reached} of {report.targets} sets in {report.duration_s:.0f} s")

# %%
# The tracks of the boats.

figure, axes = plt.subplots(layout="constrained")
for (boat, way), colour in zip(ways.items(), ("#0072B2", "#D55E00", "#009E73"), strict=True):
    north, east = np.array(way).T
    axes.plot(east, north, color=colour, label=f"boat {boat}")
for ring in (water.exterior, *water.interiors):
    north, east = ring.xy
    axes.plot(east, north, color="0.5")
axes.set(aspect="equal", xlabel="east [m]", ylabel="north [m]")
axes.legend()
plt.show()
