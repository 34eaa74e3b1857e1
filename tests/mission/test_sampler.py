"""The places of readings from instruments with their own connections."""

from datetime import timedelta

from conftest import NOON, square_survey

from grebe.core.quantities import BUILTIN
from grebe.links.base import Observation, Reading
from grebe.mission.measuring.sampler import Sampler
from grebe.mission.measuring.sampling import InSets


class Probe:
    """A thermometer that gives the readings that it is set to."""

    keys, silent = ("temperature_degc",), ()

    def __init__(self, *readings):
        self._said = list(readings)

    def readings(self):
        said, self._said = self._said, []
        return said


def test_an_estimate_that_comes_very_late_loses_no_mission():
    """A process that was suspended for a minute receives old estimates."""
    probe = Probe(Reading(age_s=60.0, values={"temperature_degc": 20.0}))
    sampler = Sampler(square_survey().targets, None, InSets(), BUILTIN, probe)
    late = Observation(time_s=100.0, state=(1.0, 2.0, 0.0, 0.0, 0.0, 0.0), age_s=60.0)
    found = sampler.instruments(late, lambda s: NOON + timedelta(seconds=s))
    assert [(one.north_m, one.east_m) for one in found] == [(1.0, 2.0)]
