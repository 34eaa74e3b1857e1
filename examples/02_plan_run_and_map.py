"""
2. Plan, run and map
====================

From an outline to maps in ten lines, through the survey file that the command line reads too.
"""

import tempfile
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.pyplot as plt
import shapely

import grebe

folder = Path(tempfile.mkdtemp())
region = grebe.clean_region(shapely.box(3.1700, 50.6360, 3.1706, 50.6364), "a pond")
planned = grebe.plan_region(region, grebe.vessel_named("spyboat"), grebe.PlanSettings(cell_m=7.0))
picture = grebe.write_plan(planned, folder / "survey.gpkg")

# %%
# The boat is simulated here; `docs/how-to/add-a-link.md` explains how to sail your own.

with grebe.SurveyFile.open(folder / "survey.gpkg") as file:
    report = grebe.run_survey(file, grebe.SimulatedWorld(), grebe.steered_by(), datetime.now(UTC))
    grebe.check_samples(file)
print(
    f"{report.reached} of {report.targets} sets, {report.samples} samples, "
    f"{report.duration_s:.0f} s"
)

# %%
# One map of each quantity, with its standard deviation.

maps = grebe.map_survey(folder / "survey.gpkg").maps
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for side, field, name in zip(
    axes, (maps[0].mean, maps[0].sd), ("mean", "standard deviation"), strict=True
):
    picture = side.imshow(field, origin="lower", cmap="cividis")
    side.set_title(f"{maps[0].quantity.label}, {name} [{maps[0].quantity.unit}]")
    figure.colorbar(picture, ax=side)
plt.show()
