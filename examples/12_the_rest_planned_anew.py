"""
12. The rest of a survey, planned anew
======================================

Grebe has two layers: a planner that puts the cells in order, and a controller that sees a few of
them ahead. When conditions differ from the plan - here a part of the lake is closed and a current
rises - the planner makes a revision from the boat's position. It is a pure function, which
`grebe run --replan` calls while the boat sails on.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely

import grebe
from grebe.core.frames import LocalFrame
from grebe.core.revision import first_revision, left_out, survey_of
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region, water_of
from grebe.planning.revisions.revise import Halfway, open_water, replanned

frame = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
lake = Region(name="a lake", frame=frame, water=shapely.box(0, 0, 80, 100))
boat = PRESETS["spyboat"]
survey = plan_survey(lake, boat, grebe.PlanSettings(cell_m=10))
old = first_revision(survey)

# %%
# After 12 sets a regatta closes a corner, and there is a current of 0.4 m/s.

reached = 12
here = tuple(survey.targets[reached - 1].set.centre)
closed = shapely.box(50, 60, 80, 100)
current = grebe.Weather(current_north_mps=0.4)
new = replanned(
    old,
    survey,
    open_water(survey, water_of(survey)).closing([closed], here),
    Halfway(reached=reached, place=here),
    vessel=boat,
    weather=current,
    reason="closed",
    note="a regatta",
)
print(f"revision {new.number} ({new.reason}): {len(left_out(old, new))} cells are left out")

# %%
# Both orders. The targets that were reached stay in front, unchanged.

figure, both = plt.subplots(1, 2, sharey=True, layout="constrained")
for axes, revision in zip(both, (old, new), strict=True):
    places = np.array([target.set.centre for target in survey_of(survey, revision).targets])
    axes.plot(*places[: reached + 1, ::-1].T, color="0.6", label="sailed")
    axes.plot(*places[reached:, ::-1].T, color="#0072B2", label="ahead")
    axes.fill([60, 60, 100, 100], [50, 80, 80, 50], color="#D55E00", alpha=0.3)
    axes.set(aspect="equal", title=f"revision {revision.number}", xlabel="east [m]")
both[0].set_ylabel("north [m]")
both[0].legend()
plt.show()
