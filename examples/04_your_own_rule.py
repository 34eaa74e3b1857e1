"""
4. A rule of your own
=====================

A rule fills in the stages of a horizon. This one aims at the current set alone, in ten steps of a
second. It is what a researcher would write first, and runs in the same loop as Grebe's rules.
"""

from dataclasses import dataclass

import grebe
from grebe.control.horizon import Horizon
from grebe.control.rules.base import Decision, Proposal, shifted
from grebe.mission.trial import meander


@dataclass(frozen=True)
class OneSet:
    """Attract every stage to the current set, and require the last node to be in it."""

    stages: int = 10
    step_s: float = 1.0
    longest_stage_s: float = 1.0

    def propose(self, situation, shape):
        """Write the horizon; nothing is solved here."""
        horizon = Horizon(shape=shape)
        horizon.duration_bounds[:] = self.step_s
        horizon.effort_weights[:] = 0.01
        aim = situation.aims[0].halfspaces
        for stage in range(shape.stages):
            horizon.attract(stage, aim, 1.0)
        horizon.require(shape.stages, aim, 1e3)
        decision = Decision(target=situation.target, split=shape.stages)
        return Proposal(horizon=horizon, decision=decision, start=shifted(situation))


# %%
# It steers the boat like any other rule.

boat, cells = grebe.vessel_named("benchmark"), meander(rows=2, columns=4)
start = (-10.0, 2.5, 0.0, 0.0, 0.0, 0.0)
for rule in (OneSet(), grebe.Lookahead()):
    trial = grebe.simulate(boat, cells, grebe.Controller(boat, cells, rule), start)
    print(f"{type(rule).__name__}: {trial.arrivals} sets in {trial.duration_s:.0f} s")
