"""Sail one mission of a campaign: the mission loop, a simulated boat, and its true positions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from grebe.campaigns.settings import Campaign
from grebe.campaigns.spread import Value
from grebe.control.controller import Controller
from grebe.core.dynamics import Weather
from grebe.core.events import MissionEvent
from grebe.core.survey import Survey
from grebe.links.base import Observation
from grebe.links.simulated import EstimateErrors, SimulatedLink
from grebe.mission.events.statistics import MissionReport
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings
from grebe.simulation.faults import Faults, FaultyPlant
from grebe.simulation.plant import Plant, mismatched
from grebe.simulation.sonde import UniformSonde
from grebe.workflow.kernel_cache import load_controller
from grebe.workflow.steering_names import rule_named

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A late mission is sailed on, up to this multiple of its allowed time, to see how late it is.
LATER = 1.5
# Numbers of a mission's random streams; those of its settings come first, one each.
NOISE, FAULTS, HULL = 1000, 1001, 1002


def sail(
    campaign: Campaign, survey: Survey, drawn: Mapping[str, Value], number: int
) -> tuple[MissionReport, NDArray[np.float64]]:
    """Return the report of a mission, and where the boat truly was at each estimate, (n, 2) [m]."""
    load_controller()
    words = {name: value for name, value in drawn.items() if isinstance(value, str)}
    numbers = {name: value for name, value in drawn.items() if not isinstance(value, str)}
    vessel = campaign.boats[words["boat"]] if words["boat"] else survey.vessel
    assert vessel is not None
    own = replace(survey, vessel=vessel)
    faults = _faults(campaign, numbers, number)
    link = _Witness(
        _plant(own, numbers, faults, _seed(campaign, number, HULL)),
        _errors(numbers),
        _seed(campaign, number, NOISE),
        faults,
    )

    def helm(route: Survey) -> Controller:
        return Controller(vessel, route.sets, rule_named(words["rule"]), corridors=route.corridors)

    report = Mission(
        own,
        helm(own),
        link,
        _Nobody(),
        MissionSettings(limit_s=LATER * campaign.success.within_s),
        pilot=helm,
    ).run()
    return report, np.array(link.truth)


class _Nobody:
    """A recorder that stores nothing: a campaign stores summaries."""

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""


class _Witness(SimulatedLink):
    """The simulated boat; it logs its true position at each observation."""

    def __init__(self, plant: Plant, errors: EstimateErrors, seed: int, faults: Faults) -> None:
        super().__init__(plant, UniformSonde(), errors, seed, faults=faults)
        self.truth: list[tuple[float, float]] = []

    def observe(self) -> Observation:
        """See `BoatLink`; the true position is also logged while there are no estimates."""
        observation = super().observe()
        self.truth.append((self._plant.state[0], self._plant.state[1]))
        return observation


def _plant(survey: Survey, drawn: Mapping[str, float], faults: Faults, seed: int) -> FaultyPlant:
    assert survey.vessel is not None
    assert survey.start is not None
    boat = mismatched(survey.vessel, drawn["mismatch"], seed)
    return FaultyPlant(boat, survey.start.at_rest(), _weather(drawn), faults)


def _seed(campaign: Campaign, number: int, stream: int) -> int:
    return int(np.random.default_rng([campaign.seed, number, stream]).integers(2**31))


def _faults(campaign: Campaign, drawn: Mapping[str, float], number: int) -> Faults:
    """The faults of a mission; they begin at times drawn uniformly from its allowed time."""
    random = np.random.default_rng([campaign.seed, number, FAULTS])
    dies_at_s, blind_at_s = random.uniform(0, campaign.success.within_s, 2)
    side: Literal["port", "starboard"] = "port" if random.uniform() < 0.5 else "starboard"
    dies = random.uniform() < drawn["thruster_dies"]
    blind_s = drawn["blind_s"]
    return Faults(
        dead=side if dies else None,
        dead_at_s=float(dies_at_s),
        blind=((float(blind_at_s), float(blind_at_s) + blind_s),) if blind_s > 0 else (),
    )


def _errors(drawn: Mapping[str, float]) -> EstimateErrors:
    return EstimateErrors(
        position_m=drawn["position_noise_m"],
        heading_rad=math.radians(drawn["heading_noise_deg"]),
        velocity_mps=drawn["velocity_noise_mps"],
        lost_share=drawn["lost_share"],
        late_s=drawn["late_s"],
    )


def _weather(drawn: Mapping[str, float]) -> Weather:
    current, wind = drawn["current_mps"], drawn["wind_n"]
    goes, blows = math.radians(drawn["current_to_deg"]), math.radians(drawn["wind_to_deg"])
    return Weather(
        current_north_mps=current * math.cos(goes),
        current_east_mps=current * math.sin(goes),
        wind_force_north_n=wind * math.cos(blows),
        wind_force_east_n=wind * math.sin(blows),
    )
