"""Grebe: an unmanned boat surveys a lake by itself and comes back with maps of its water.

One way through it, and the folders are the stations: region -> cells -> route -> targets ->
plan of thrusts -> boat -> samples -> map. The names below are the public ones; each is
imported only when it is used, so that `import grebe` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from grebe.control.controller import Command, Controller
    from grebe.control.settings import ControlSettings
    from grebe.dynamics import Weather
    from grebe.errors import GrebeError
    from grebe.frames import LocalFrame
    from grebe.link.base import BoatLink, Observation
    from grebe.mapping.kriging import krige
    from grebe.mapping.maps import Mapper
    from grebe.mapping.variogram import fit_variogram
    from grebe.mission import Mission, MissionReport
    from grebe.planning.planner import plan_survey
    from grebe.planning.region import Region, clean_region
    from grebe.planning.settings import PlanSettings
    from grebe.sets import TargetSet
    from grebe.simulated_mission import simulate
    from grebe.store import SurveyFile
    from grebe.survey import Survey
    from grebe.vessel import Vessel, vessel_named

_HOME = {
    "BoatLink": "link.base",
    "Command": "control.controller",
    "ControlSettings": "control.settings",
    "Controller": "control.controller",
    "GrebeError": "errors",
    "LocalFrame": "frames",
    "Mapper": "mapping.maps",
    "Mission": "mission",
    "MissionReport": "mission",
    "Observation": "link.base",
    "PlanSettings": "planning.settings",
    "Region": "planning.region",
    "Survey": "survey",
    "SurveyFile": "store",
    "TargetSet": "sets",
    "Vessel": "vessel",
    "Weather": "dynamics",
    "clean_region": "planning.region",
    "fit_variogram": "mapping.variogram",
    "krige": "mapping.kriging",
    "plan_survey": "planning.planner",
    "simulate": "simulated_mission",
    "vessel_named": "vessel",
}

__all__ = [
    "BoatLink",
    "Command",
    "ControlSettings",
    "Controller",
    "GrebeError",
    "LocalFrame",
    "Mapper",
    "Mission",
    "MissionReport",
    "Observation",
    "PlanSettings",
    "Region",
    "Survey",
    "SurveyFile",
    "TargetSet",
    "Vessel",
    "Weather",
    "clean_region",
    "fit_variogram",
    "krige",
    "plan_survey",
    "simulate",
    "vessel_named",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'grebe' has no attribute {name!r}")
    return getattr(importlib.import_module(f"grebe.{_HOME[name]}"), name)
