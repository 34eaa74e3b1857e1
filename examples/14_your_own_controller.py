"""
14. A controller of your own
============================

A controller is any object with the protocol `Helm`: the loop calls it every `step_s` for the
thrusts at a state. This one turns towards the next set and goes there. It sails in the same loop,
with the same simulated boat and in the same weather as Grebe's own.
"""

import math

import grebe
from grebe.mission.trial import meander


class Pursuit:
    """Turns towards the middle of the next set, and goes at the middle of its speed window."""

    step_s = 0.2

    def __init__(self, vessel, targets):
        self.vessel, self.targets, self.reached = vessel, targets, 0

    def step(self, state, weather, elapsed_s):  # noqa: ARG002
        """Return thrusts in proportion to the errors of bearing and speed."""
        north, east, heading, surge, _, yaw_rate = state
        target = self.targets[self.reached]
        to_north, to_east = target.centre[0] - north, target.centre[1] - east
        off = math.remainder(math.atan2(to_east, to_north) - heading, 2 * math.pi)
        pace = 0.5 * (target.speed_min_mps + target.speed_max_mps) * max(math.cos(off), 0.0)
        ahead = 0.5 * self.vessel.surge_drag_n(pace) + 8.0 * (pace - surge)
        turn = 6.0 * off - 4.0 * yaw_rate
        return grebe.Command(thrusts=(ahead + turn, ahead - turn), target=self.reached)


# %%
# In still water, and in a current that neither controller knows.

boat, cells = grebe.vessel_named("spyboat"), meander(rows=2, columns=4)
start = (-10.0, 2.5, 0.0, 0.0, 0.0, 0.0)
for current in (0.0, 0.3):
    world = grebe.Conditions(weather=grebe.Weather(current_east_mps=current), limit_s=300.0)
    for helm in (Pursuit(boat, cells), grebe.Controller(boat, cells)):
        trial = grebe.simulate(boat, cells, helm, start, world)
        name = type(helm).__name__
        print(f"{current:g} m/s, {name}: {trial.arrivals} sets in {trial.duration_s:.0f} s")
