"""
1. Plan a lake
==============

A pond with an island becomes an ordered sequence of target sets, with corridors that keep the boat
off land.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely

import grebe

# %%
# The outline of a pond, in degrees. `grebe.read_region` reads one from a file.

shore = [
    (3.1700, 50.6360),
    (3.1712, 50.6360),
    (3.1714, 50.6366),
    (3.1706, 50.6368),
    (3.1699, 50.6364),
]
island = [(3.17045, 50.6363), (3.17065, 50.6363), (3.17065, 50.6365), (3.17045, 50.6365)]
region = grebe.clean_region(shapely.Polygon(shore, [island]), "a pond")

# %%
# Cells of 8 m, a boat, and a speed window in which its sensors can measure.

settings = grebe.PlanSettings(cell_m=8.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0)
planned = grebe.plan_region(region, grebe.vessel_named("blueboat"), settings)
print(f"{len(planned.survey.targets)} targets, {planned.outcome.time_s / 60:.1f} min predicted")
print(f"{planned.check.outside_m2:.0f} m2 of the route lie outside the water")

# %%
# Draw the plan. In local axes x is north and y is east.

figure, axes = plt.subplots()
for cell in planned.survey.cells:
    north, east = cell.exterior.xy
    axes.fill(east, north, facecolor="#56B4E9", edgecolor="white", alpha=0.6)
way = np.array([target.set.centre for target in planned.survey.targets])
axes.plot(way[:, 1], way[:, 0], color="#D55E00", lw=1)
axes.set(aspect="equal", xlabel="east [m]", ylabel="north [m]", title="Cells and their order")
plt.show()
