"""A mission that has nothing left to do reports that."""

from grebe.core.vessel import PRESETS
from grebe.mission.events.statistics import Statistics


def test_a_mission_whose_targets_were_reached_before_says_so():
    vessel = PRESETS["blueboat"]
    idle = Statistics(vessel, targets=5, reached=5).report()
    assert idle.ended is None
    assert idle.message == "nothing was left to do: every target had already been reached"
    assert Statistics(vessel, targets=5, reached=3).report().message == ""
