"""Reports measurements as events, and passes the guard what it needs to know of them."""

from __future__ import annotations

from collections.abc import Sequence

from grebe.core.events import SampleTaken, Warned
from grebe.core.sets import TargetSet
from grebe.core.survey import Target
from grebe.links.base import Observation
from grebe.mission.events.publisher import Publisher
from grebe.mission.measuring.sampler import Sampler
from grebe.mission.safety.guard import Guard

# The quantity for the depth of the water below the boat.
DEPTH = "water_depth_m"


class Measuring:
    """Reports the samples of one boat's `sampler`."""

    def __init__(self, sampler: Sampler, guard: Guard, publisher: Publisher) -> None:
        self._sampler, self._guard, self._publisher = sampler, guard, publisher

    def take(self, observation: Observation, entered: Sequence[Target], ahead: TargetSet) -> None:
        """Measure at an estimate that entered some targets, if a sample is due."""
        time = self._publisher.time_at(observation.time_s)
        sample = self._sampler.take(observation, time, entered, ahead)
        if sample is not None:
            self._guard.depth_m = sample.values.get(DEPTH)
            self._publisher.publish(SampleTaken, observation.time_s, sample=sample)

    def read_instruments(self, observation: Observation) -> None:
        """Take the readings and the condition of instruments with their own connections."""
        for sample in self._sampler.instruments(observation, self._publisher.time_at):
            self._guard.depth_m = sample.values.get(DEPTH, self._guard.depth_m)
            self._publisher.publish(SampleTaken, observation.time_s, sample=sample)
        self._guard.mute = self._sampler.mute(observation.time_s)
        for code, message in self._sampler.notes():
            self._publisher.publish(Warned, observation.time_s, code=code, message=message)
