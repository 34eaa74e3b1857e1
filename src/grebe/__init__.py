"""Grebe: an unmanned boat surveys a lake by itself and comes back with maps of its water.

One way through it, and the folders are the stations: region -> cells -> route -> targets ->
plan of thrusts -> boat -> samples -> map. The names below are the public ones; each is
imported only when it is used, so that `import grebe` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from grebe.control.controller import Command, Controller, Margins
    from grebe.control.rules.base import Rule
    from grebe.control.rules.dual import Dual
    from grebe.control.rules.lookahead import Lookahead
    from grebe.control.rules.single import Single
    from grebe.control.solvers.builders import Fast, Fatrop, Ipopt
    from grebe.core.dynamics import Weather
    from grebe.core.errors import GrebeError
    from grebe.core.frames import LocalFrame
    from grebe.core.plan_settings import PlanSettings
    from grebe.core.sets import TargetSet
    from grebe.core.survey import Survey
    from grebe.core.vessel import Vessel, vessel_named
    from grebe.io.store import SurveyFile
    from grebe.links.base import BoatLink, Observation
    from grebe.mapping.kriging import krige
    from grebe.mapping.maps import Mapper
    from grebe.mapping.variogram import fit_variogram
    from grebe.mission.loop import Mission
    from grebe.mission.statistics import MissionReport
    from grebe.planning.planner import plan_survey
    from grebe.planning.region import Region, clean_region
    from grebe.workflow.run import run_survey
    from grebe.workflow.simulated import SimulatedWorld

_HOME = {
    "BoatLink": "links.base",
    "Command": "control.controller",
    "Controller": "control.controller",
    "Dual": "control.rules.dual",
    "Fast": "control.solvers.builders",
    "Fatrop": "control.solvers.builders",
    "GrebeError": "core.errors",
    "Ipopt": "control.solvers.builders",
    "LocalFrame": "core.frames",
    "Lookahead": "control.rules.lookahead",
    "Mapper": "mapping.maps",
    "Margins": "control.controller",
    "Mission": "mission.loop",
    "MissionReport": "mission.statistics",
    "Observation": "links.base",
    "PlanSettings": "core.plan_settings",
    "Region": "planning.region",
    "Rule": "control.rules.base",
    "SimulatedWorld": "workflow.simulated",
    "Single": "control.rules.single",
    "Survey": "core.survey",
    "SurveyFile": "io.store",
    "TargetSet": "core.sets",
    "Vessel": "core.vessel",
    "Weather": "core.dynamics",
    "clean_region": "planning.region",
    "fit_variogram": "mapping.variogram",
    "krige": "mapping.kriging",
    "plan_survey": "planning.planner",
    "run_survey": "workflow.run",
    "vessel_named": "core.vessel",
}

__all__ = [
    "BoatLink",
    "Command",
    "Controller",
    "Dual",
    "Fast",
    "Fatrop",
    "GrebeError",
    "Ipopt",
    "LocalFrame",
    "Lookahead",
    "Mapper",
    "Margins",
    "Mission",
    "MissionReport",
    "Observation",
    "PlanSettings",
    "Region",
    "Rule",
    "SimulatedWorld",
    "Single",
    "Survey",
    "SurveyFile",
    "TargetSet",
    "Vessel",
    "Weather",
    "clean_region",
    "fit_variogram",
    "krige",
    "plan_survey",
    "run_survey",
    "vessel_named",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'grebe' has no attribute {name!r}")
    return getattr(importlib.import_module(f"grebe.{_HOME[name]}"), name)
