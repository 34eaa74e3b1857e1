"""The simulated boat behind the link."""

from __future__ import annotations

from collections.abc import Mapping

from grebe.errors import LinkError
from grebe.link.base import Observation, State
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import Sonde

OBSERVATION_PERIOD_S = 0.1


class SimulatedLink:
    """Observes a plant every `OBSERVATION_PERIOD_S`, without noise, and reads a sonde."""

    def __init__(self, plant: Plant, sonde: Sonde) -> None:
        self._plant = plant
        self._sonde = sonde
        self._started = False
        self._closed = False

    def observe(self) -> Observation:
        """Advance the plant to its next estimate; the first one is the start itself."""
        if self._closed:
            raise LinkError("The simulated boat has been closed.")
        if self._started:
            self._plant.advance(OBSERVATION_PERIOD_S)
        self._started = True
        north, east, heading, surge, sway, yaw_rate = self._plant.state
        state: State = (north, east, heading, surge, sway, yaw_rate)
        return Observation(time_s=self._plant.time_s, state=state)

    def command(self, thrusts: tuple[float, float]) -> None:
        """Set the thrusts until the next command."""
        self._plant.command(thrusts)

    def measure(self) -> Mapping[str, float]:
        """Return what the sonde reads here and now."""
        return self._sonde.read(self._plant.state[0], self._plant.state[1])

    def close(self) -> None:
        """Leave the boat without thrust."""
        self._plant.command((0.0, 0.0))
        self._closed = True
