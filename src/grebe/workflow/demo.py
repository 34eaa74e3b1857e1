"""The survey of the demo: a hectare of Lac du Héron."""

from __future__ import annotations

import shapely

from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region

# About a hectare, the size of the region of the paper's Fig. 7, whose coordinates are not printed.
# The shape is ours, the place is Lac du Heron.
HERON = LocalFrame(origin_lon_deg=3.171153, origin_lat_deg=50.636268)
OUTLINE_M = ((-48, -40), (-52, 10), (-30, 48), (15, 56), (46, 38), (50, -12), (24, -50), (-20, -54))
NOTE = "Illustrative: the outline is a stand-in and not the paper's region."


def demo_survey() -> Survey:
    """Plan the demo's survey."""
    region = Region(
        name="Lac du Héron (illustrative)", frame=HERON, water=shapely.Polygon(OUTLINE_M)
    )
    return plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=5.0))
