"""
10. A campaign of simulated missions
====================================

A few missions in different weather, each a pure function of the settings and its number, and what
they imply for the next one. `grebe campaign` does this with very many.
"""

import matplotlib.pyplot as plt
import shapely

import grebe
from grebe.campaigns.certificate import Claim, clopper_pearson_lower
from grebe.campaigns.engine import Serial
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.campaigns.task import Scene
from grebe.core.frames import LocalFrame
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region

frame = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
pond = Region(name="pond", frame=frame, water=shapely.box(0, 0, 20, 30))
survey = plan_survey(pond, PRESETS["spyboat"], grebe.PlanSettings(cell_m=10))
campaign = Campaign(
    name="a pond",
    success=Success(within_s=120),
    claim=Claim(confidence=0.9),
    missions=6,
    spreads={
        "current_mps": spread_of("current_mps", [0.0, 0.3]),
        "wind_n": spread_of("wind_n", {"mean": 3, "sd": 1, "low": 0}),
    },
)

# %%
# `Processes()` or `Dask()` in place of `Serial()` gives the same results.

scene = Scene(campaign=campaign, survey=survey)
missions = [one for _, one in Serial().results(scene, range(campaign.missions))]
successes = sum(one.success for one in missions)
limit = clopper_pearson_lower(successes, len(missions), campaign.claim.confidence)
print(f"{successes} of {len(missions)} succeeded: at least {limit:.0%} do, with 90 % confidence")

# %%
# The duration of the missions over the current.

figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
axes.plot([one.drawn["current_mps"] for one in missions], [one.duration_s for one in missions], "o")
axes.set(xlabel="current [m/s]", ylabel="time of the mission [s]", ylim=(0, None))
plt.show()
