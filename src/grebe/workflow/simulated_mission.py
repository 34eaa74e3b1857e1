"""Run a survey with the simulated boat: water, plant, sonde and controller put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from grebe.control.controller import Controller
from grebe.control.settings import ControlSettings
from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError, SurveyFileError, UsageError
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.io.readers.track import read_track
from grebe.io.store import SurveyFile
from grebe.links.simulated import EXACT, OBSERVATION_PERIOD_S, EstimateErrors, SimulatedLink
from grebe.mission.loop import Mission, MissionReport, Progress
from grebe.simulation.plant import Plant, mismatched
from grebe.simulation.sonde import Sonde
from grebe.simulation.water import Water, conditioned_water, free_water


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """The true world of a simulation, of which the controller is told nothing.

    `weather`; `mismatch`, the share by which the boat may differ from its model; `errors` of the
    state estimates; `water_from` a survey file or a CSV track whose samples condition the water
    (None: free fields); `seed`.
    """

    weather: Weather = CALM
    mismatch: float = 0.0
    errors: EstimateErrors = EXACT
    water_from: Path | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.mismatch < 1:
            raise UsageError(f"A boat cannot differ by {self.mismatch} from its model; give 0-1.")


def simulate(
    survey_file: SurveyFile,
    control: ControlSettings,
    settings: SimulationSettings,
    started: datetime,
    *,
    resume: bool = False,
    force: bool = False,
    watch: Callable[[Progress], None] | None = None,
) -> MissionReport:
    """Run the mission of a survey file with the simulated boat.

    With `resume` the boat starts where and when the recorded track ends and the reached
    targets stay reached; with `force` a recorded mission is forgotten, once everything that
    the new one needs is there. Raises `PlanError` for a survey without targets and
    `SurveyFileError` for one that has been run and is neither resumed nor forced.
    """
    survey = survey_file.survey
    if survey.vessel is None or survey.start is None or not survey.targets:
        raise PlanError(f"{survey_file.path} has no targets to steer to; make one with grebe plan.")
    reached = survey_file.progress().reached
    track = survey_file.track()
    if len(track) and not (resume or force):
        raise SurveyFileError(
            f"{survey_file.path} holds a mission already ({reached} of {len(survey.targets)} "
            "targets reached); go on with --resume, or begin anew with --force."
        )
    start = survey.start.at_rest()
    if len(track) and resume:
        north, east, heading, surge, sway, yaw_rate = track.states[-1].tolist()
        start = (north, east, heading, surge, sway, yaw_rate)
        # Simulated time runs ahead of the clock: the new part must not begin before the old ends.
        started = max(started, track.times[-1] + timedelta(seconds=OBSERVATION_PERIOD_S))
    elif not resume:
        reached = 0
    survey_file.claim()
    water = true_water(survey, settings, survey_file.quantities)
    controller = Controller(
        survey.vessel,
        survey.sets,
        control,
        reached=reached,
        corridors=survey.corridors,
    )
    if len(track) and not resume:
        survey_file.clear_mission()
    boat = mismatched(survey.vessel, settings.mismatch, settings.seed)
    plant = Plant(boat, start, settings.weather)
    link = SimulatedLink(plant, Sonde(water, settings.seed), settings.errors, settings.seed)
    source = settings.water_from.name if settings.water_from else "free fields"
    survey_file.set_meta("water", f"simulated, {source}, seed {settings.seed}")
    return Mission(survey_file, controller, link, started, watch).run()


def true_water(
    survey: Survey, settings: SimulationSettings, quantities: Quantities = LIMNOLOGICAL
) -> Water:
    """Draw the true water of a survey's region: those of some quantities that it can have."""
    bounds = survey.water.bounds
    if settings.water_from is None:
        return free_water(bounds, settings.seed, quantities)
    known = _known_samples(survey, settings.water_from, quantities)
    north0, east0, north1, east1 = bounds
    near = np.all(
        (known.positions >= np.array([north0, east0]) - 1000.0)
        & (known.positions <= np.array([north1, east1]) + 1000.0),
        axis=1,
    )
    if near.sum() < 10:
        raise PlanError(
            f"{settings.water_from}: {int(near.sum())} of its samples lie within a kilometre of "
            "the survey's region; the water can only be conditioned on samples of the same lake."
        )
    known = known.rows(near)
    values = {
        key: np.where(known.usable(key), known.values[key], np.nan)
        for key in quantities
        if key in known.values
    }
    return conditioned_water(bounds, known.positions, values, settings.seed)


def _known_samples(survey: Survey, source: Path, quantities: Quantities) -> Samples:
    """The samples of a track or of a survey file in the survey's frame."""
    if source.suffix.lower() == ".csv":
        track = read_track(source, quantities=quantities)
        positions = survey.frame.to_local(track.lonlat)
        times = np.zeros(len(positions)) if track.times is None else track.times
        return Samples.of(
            times=times, positions=positions, values=track.values, quantities=quantities
        )
    with SurveyFile.open(source) as known:
        samples = known.samples()
        lonlat = known.survey.frame.to_wgs84(samples.positions)
    return samples.moved(survey.frame.to_local(lonlat))
