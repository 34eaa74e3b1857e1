"""Grebe: an unmanned boat surveys a lake by itself and comes back with maps of its water.

Data flows one way, and the folders follow it: region -> cells -> route -> targets ->
plan of thrusts -> boat -> samples -> map. The names below are the public API, and `dir(grebe)`
lists them. Each is imported on first use, so `import grebe` is quick.
"""

from __future__ import annotations

import importlib
import warnings
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
    from grebe.core.quantities import BUILTIN, Quantities, Quantity
    from grebe.core.samples import Samples
    from grebe.core.sets import TargetSet
    from grebe.core.survey import Survey
    from grebe.core.vessel import Vessel, vessel_named
    from grebe.io.store import SurveyFile
    from grebe.links.base import BoatLink, BoatStatus, Observation
    from grebe.links.simulated import EstimateErrors
    from grebe.mapping.covariance.variogram import fit_variogram
    from grebe.mapping.fields.kriging import krige
    from grebe.mapping.maps import Mapper, MapSettings
    from grebe.mapping.methods.kriging import Kriging
    from grebe.mapping.methods.spde import Spde
    from grebe.mission.departure import Departure
    from grebe.mission.events.recorders import MemoryRecorder
    from grebe.mission.events.statistics import MissionReport
    from grebe.mission.loop import Mission
    from grebe.mission.measuring.sampling import InSets, InWindow
    from grebe.mission.settings import MissionSettings
    from grebe.mission.trial import Conditions, Trial, simulate
    from grebe.planning.planned import Planned
    from grebe.planning.region import Region, clean_region
    from grebe.report.page import write_report
    from grebe.workflow.differences import compare_surveys
    from grebe.workflow.maps import map_survey, write_maps
    from grebe.workflow.plans import plan_region, read_region, write_plan
    from grebe.workflow.quality import check_samples
    from grebe.workflow.run import run_survey, steered_by
    from grebe.workflow.simulated import SimulatedWorld
    from grebe.workflow.tracks import import_track

_HOME = {
    "BUILTIN": "core.quantities",
    "BoatLink": "links.base",
    "BoatStatus": "links.base",
    "Command": "control.controller",
    "Conditions": "mission.trial",
    "Controller": "control.controller",
    "Departure": "mission.departure",
    "Dual": "control.rules.dual",
    "EstimateErrors": "links.simulated",
    "Fast": "control.solvers.builders",
    "Fatrop": "control.solvers.builders",
    "GrebeError": "core.errors",
    "InSets": "mission.measuring.sampling",
    "InWindow": "mission.measuring.sampling",
    "Ipopt": "control.solvers.builders",
    "Kriging": "mapping.methods.kriging",
    "LocalFrame": "core.frames",
    "Lookahead": "control.rules.lookahead",
    "MapSettings": "mapping.maps",
    "Mapper": "mapping.maps",
    "Margins": "control.controller",
    "MemoryRecorder": "mission.events.recorders",
    "Mission": "mission.loop",
    "MissionReport": "mission.events.statistics",
    "MissionSettings": "mission.settings",
    "Observation": "links.base",
    "PlanSettings": "core.plan_settings",
    "Planned": "planning.planned",
    "Quantities": "core.quantities",
    "Quantity": "core.quantities",
    "Region": "planning.region",
    "Rule": "control.rules.base",
    "Samples": "core.samples",
    "SimulatedWorld": "workflow.simulated",
    "Single": "control.rules.single",
    "Spde": "mapping.methods.spde",
    "Survey": "core.survey",
    "SurveyFile": "io.store",
    "TargetSet": "core.sets",
    "Trial": "mission.trial",
    "Vessel": "core.vessel",
    "Weather": "core.dynamics",
    "check_samples": "workflow.quality",
    "clean_region": "planning.region",
    "compare_surveys": "workflow.differences",
    "fit_variogram": "mapping.covariance.variogram",
    "import_track": "workflow.tracks",
    "krige": "mapping.fields.kriging",
    "map_survey": "workflow.maps",
    "plan_region": "workflow.plans",
    "read_region": "workflow.plans",
    "run_survey": "workflow.run",
    "simulate": "mission.trial",
    "steered_by": "workflow.run",
    "vessel_named": "core.vessel",
    "write_maps": "workflow.maps",
    "write_plan": "workflow.plans",
    "write_report": "report.page",
}
# Names of version 0.1 and those that replaced them.
_RENAMED = {"fly": "simulate"}

__all__ = [
    "BUILTIN",
    "BoatLink",
    "BoatStatus",
    "Command",
    "Conditions",
    "Controller",
    "Departure",
    "Dual",
    "EstimateErrors",
    "Fast",
    "Fatrop",
    "GrebeError",
    "InSets",
    "InWindow",
    "Ipopt",
    "Kriging",
    "LocalFrame",
    "Lookahead",
    "MapSettings",
    "Mapper",
    "Margins",
    "MemoryRecorder",
    "Mission",
    "MissionReport",
    "MissionSettings",
    "Observation",
    "PlanSettings",
    "Planned",
    "Quantities",
    "Quantity",
    "Region",
    "Rule",
    "Samples",
    "SimulatedWorld",
    "Single",
    "Spde",
    "Survey",
    "SurveyFile",
    "TargetSet",
    "Trial",
    "Vessel",
    "Weather",
    "check_samples",
    "clean_region",
    "compare_surveys",
    "fit_variogram",
    "import_track",
    "krige",
    "map_survey",
    "plan_region",
    "read_region",
    "run_survey",
    "simulate",
    "steered_by",
    "vessel_named",
    "write_maps",
    "write_plan",
    "write_report",
]


def __getattr__(name: str) -> object:
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("grebe")
    if name in _RENAMED:
        new = _RENAMED[name]
        warnings.warn(f"grebe.{name} is now grebe.{new}", DeprecationWarning, stacklevel=2)
        name = new
    if name not in _HOME:
        raise AttributeError(f"module 'grebe' has no attribute {name!r}")
    return getattr(importlib.import_module(f"grebe.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return list(__all__)
