"""
3. A current that the controller does not know
==============================================

An observer estimates current and wind from the boat's motion, here with the paper's rule and with
Grebe's.
"""

import matplotlib.pyplot as plt

import grebe
from grebe.mission.trial import meander

boat, cells = grebe.vessel_named("benchmark"), meander(rows=4, columns=6)
start = (-10.0, 2.5, 0.0, 0.0, 0.0, 0.0)
weather = grebe.Weather(current_north_mps=0.2, current_east_mps=-0.2)
conditions = grebe.Conditions(weather=weather, errors=grebe.EstimateErrors(velocity_mps=0.02))

# %%
# `Dual` is problem (8) of the paper, `Lookahead` minimises the time through the next sets.

figure, axes = plt.subplots()
for rule, colour in ((grebe.Dual(), "#0072B2"), (grebe.Lookahead(), "#D55E00")):
    trial = grebe.simulate(boat, cells, grebe.Controller(boat, cells, rule), start, conditions)
    name = type(rule).__name__
    print(f"{name}: {trial.arrivals} sets in {trial.duration_s:.0f} s")
    axes.plot(trial.track[:, 2], trial.track[:, 1], color=colour, label=name)
found = trial.estimates[-1].weather
print(f"current found: {found.current_north_mps:+.2f} north, {found.current_east_mps:+.2f} east")
for cell in cells:
    north, east = cell.polygon.exterior.xy
    axes.plot(east, north, color="0.8", lw=0.8, zorder=0)
axes.set(aspect="equal", xlabel="east [m]", ylabel="north [m]")
axes.legend()
plt.show()
