import os, time
from grebe.io.store.timestamps import time_text
from grebe.links.simulated import SimulatedLink
from grebe.mission.recorders import SurveyRecorder
from grebe.core.events import Reached, SampleTaken, Step
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

WITNESS = os.open(
    "/work/w_survive/tmpr6uj2aid/here/witness", os.O_WRONLY | os.O_CREAT | os.O_APPEND
)
keep = SurveyRecorder.record_together


def record_together(self, events):
    more = keep(self, events)
    for event in events:
        if isinstance(event, SampleTaken):
            os.write(WITNESS, f"sample {time_text(event.sample.time)}\n".encode())
        elif isinstance(event, Reached):
            os.write(WITNESS, f"reached {event.target_seq}\n".encode())
        elif isinstance(event, Step):
            os.write(WITNESS, f"step {time_text(event.time)}\n".encode())
    return more


SurveyRecorder.record_together = record_together


class Boat(SimulatedLink):
    def observe(self):
        time.sleep(0.002)
        return super().observe()


def boat_at(departure):
    plant = Plant(departure.vessel, departure.state)
    return Boat(plant, UniformSonde(values={"ph": 7.0}), source="killed")
