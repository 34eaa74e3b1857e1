"""
6. Events as they happen
========================

A mission reports what happens as events. A listener receives them; this one stops the mission after
four sets.
"""

import shapely

import grebe
from grebe.core.events import Ended, Prediction, Reached
from grebe.links.simulated import SimulatedLink
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

region = grebe.clean_region(shapely.box(3.1700, 50.6360, 3.1706, 50.6364), "a pond")
boat = grebe.vessel_named("spyboat")
survey = grebe.plan_region(region, boat, grebe.PlanSettings(cell_m=8.0)).survey

link = SimulatedLink(Plant(boat, survey.start.at_rest()), UniformSonde())
recorder = grebe.MemoryRecorder()


def listen(event):
    """Print some of the events, and stop the mission after four sets."""
    if isinstance(event, Reached):
        print(f"{event.elapsed_s:5.1f} s  set {event.target_seq} is reached")
        if event.count == 4:
            mission.stop("four sets are enough for an example")
    elif isinstance(event, Ended):
        print(f"{event.elapsed_s:5.1f} s  ended: {event.reason.value}, {event.message}")


mission = grebe.Mission(
    survey, grebe.Controller(boat, survey.sets, corridors=survey.corridors), link, recorder,
    listeners=[listen],
)  # fmt: skip
report = mission.run()

# %%
# The recorder has all events, including the horizon that each step planned.

horizons = recorder.of(Prediction)
print(
    f"{len(recorder.events)} events, {len(horizons)} horizons of {len(horizons[0].thrusts)} stages"
)
