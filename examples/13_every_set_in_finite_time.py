"""
13. Every set in finite time
============================

The paper's proof of arrival needs sets in which the boat can stay. This example shows which sets
allow that, and for the others the arrivals in currents that the controller does not know.
"""

import matplotlib.pyplot as plt
import numpy as np

import grebe
from grebe.control.invariance import FreeBounds, SetCheck
from grebe.core.events import Reached
from grebe.core.sets import rectangle
from grebe.mission.trial import meander

boat = grebe.vessel_named("spyboat")
bounds = FreeBounds(sway_mps=0.1, yaw_rate_radps=0.2)

# %%
# The boat can stay in a cell whose speed window includes rest. It cannot stay in one whose window
# requires it to move: if it heads out at the top of the window, it is outside a second later,
# whatever it does.

for window in ((-0.3, 0.3), (1.0, 2.0)):
    found = SetCheck(boat, rectangle((0, 5), (0, 5), window), 1.0).search(bounds, states=256)
    what = "is kept" if found.holds_as_far_as_seen else f"is left by {found.worst_excess:.1f} m"
    print(f"window {window}: the worst of {found.states} states {what}")

# %%
# So arrival does not follow from invariance. If the model is exact, it follows from the plan
# itself: shifted by a step, the plan still enters its sets, at a cost that is lower by the time
# that passed. Disturbances delay the arrival; here they are currents in six directions.

cells, start = meander(rows=3, columns=5), (-6.0, 2.5, 0.0, 0.0, 0.0, 0.0)
figure, axes = plt.subplots(layout="constrained")
for speed, colour in ((0.0, "0.3"), (0.2, "#0072B2"), (0.4, "#D55E00")):
    last = []
    for towards in np.linspace(0, 2 * np.pi, 6, endpoint=False) if speed else [0.0]:
        weather = grebe.Weather(
            current_north_mps=speed * np.cos(towards), current_east_mps=speed * np.sin(towards)
        )
        conditions = grebe.Conditions(weather=weather)
        trial = grebe.simulate(boat, cells, grebe.Controller(boat, cells), start, conditions)
        arrivals = [event.elapsed_s for event in trial.recorder.of(Reached)]
        axes.step(arrivals, np.arange(1, len(arrivals) + 1), where="post", color=colour, lw=0.8)
        last.append(arrivals[-1] if len(arrivals) == len(cells) else np.inf)
    print(f"{speed:.1f} m/s: the last of {len(cells)} sets after {max(last):.0f} s at most")
axes.set(xlabel="time [s]", ylabel="sets reached")
plt.show()
