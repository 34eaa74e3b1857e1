"""The simulated world of a survey: true water, plant, sonde, and the link to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError, UsageError
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.samples import Samples
from grebe.core.survey import Survey
from grebe.io.readers.track import read_track
from grebe.io.store import SurveyFile
from grebe.links.simulated import EXACT, EstimateErrors, SimulatedLink
from grebe.mission.departure import Departure
from grebe.simulation.faults import NO_FAULTS, Faults, FaultyPlant
from grebe.simulation.plant import Plant, mismatched
from grebe.simulation.sonde import Sonde
from grebe.simulation.water import Water, conditioned_water, free_water

# Samples farther than this from the region say nothing about its water [m].
NEAR_M = 1000.0
FEWEST_NEAR = 10
# Difference between the seeds of two boats' noise.
SEEDS_APART = 10_007


@dataclass(frozen=True, kw_only=True)
class SimulatedWorld:
    """The true world of a simulation, of which the controller knows nothing.

    `weather`; `mismatch`, the share by which the boat may differ from its model; `errors` of the
    state estimates; `water_from`, a survey file or a CSV track whose samples condition the water
    (None: free fields); `seed`; `faults` of the boat; `boat`, its number in a fleet, whose boats
    sail the same water with noise of their own. Called with a departure, it returns the link to the
    boat in that world.
    """

    weather: Weather = CALM
    mismatch: float = 0.0
    errors: EstimateErrors = EXACT
    water_from: Path | None = None
    seed: int = 1
    faults: Faults = NO_FAULTS
    boat: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.mismatch < 1:
            raise UsageError(
                f"A boat cannot differ by {self.mismatch} from its model; give 0 to 1."
            )

    def __call__(self, departure: Departure) -> SimulatedLink:
        """Put the boat where it sets out, and return the link to it."""
        water = true_water(departure.survey, self.water_from, self.seed, departure.quantities)
        own = self.seed + SEEDS_APART * (self.boat - 1)
        boat = mismatched(departure.vessel, self.mismatch, own)
        plant = (
            Plant(boat, departure.state, self.weather)
            if self.faults == NO_FAULTS
            else FaultyPlant(boat, departure.state, self.weather, self.faults)
        )
        fields = self.water_from.name if self.water_from else "free fields"
        source = f"simulated, {fields}, seed {self.seed}"
        return SimulatedLink(plant, Sonde(water, own), self.errors, own, source, self.faults)


def true_water(
    survey: Survey,
    water_from: Path | None,
    seed: int,
    quantities: Quantities = LIMNOLOGICAL,
) -> Water:
    """Draw the true water of a survey's region, with those of the quantities that it can have."""
    bounds = survey.water.bounds
    if water_from is None:
        return free_water(bounds, seed, quantities)
    known = _known_samples(survey, water_from, quantities)
    north0, east0, north1, east1 = bounds
    near = np.all(
        (known.positions >= np.array([north0, east0]) - NEAR_M)
        & (known.positions <= np.array([north1, east1]) + NEAR_M),
        axis=1,
    )
    if near.sum() < FEWEST_NEAR:
        raise PlanError(
            f"{water_from}: {int(near.sum())} of its samples lie within a kilometre of "
            "the survey's region; the water can only be conditioned on samples of the same lake."
        )
    known = known.rows(near)
    values = {
        key: np.where(known.usable(key), known.values[key], np.nan)
        for key in quantities
        if key in known.values
    }
    return conditioned_water(bounds, known.positions, values, seed)


def _known_samples(survey: Survey, source: Path, quantities: Quantities) -> Samples:
    """Return the samples of a track or of a survey file, in the survey's frame."""
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
