"""A boat without estimates: where it must be by its model, and how it is braked there."""

from __future__ import annotations

from grebe.control.station import StationKeeper
from grebe.core.dynamics import Weather
from grebe.core.events import State, Thrusts
from grebe.links.base import Observation
from grebe.mission.safety.fence import dead_reckoned

# A blind boat is braked until dead reckoning gives a surge below this [m/s].
LEAST_WAY_MPS = 0.05


class DeadReckoning:
    """Follows a boat while it is blind. `state` is where it must be; None if it is not blind."""

    def __init__(self) -> None:
        self._last: tuple[float, State] | None = None

    @property
    def state(self) -> State | None:
        """See the class."""
        return self._last and self._last[1]

    def end(self) -> None:
        """Forget where the boat must be, since a usable estimate says where it is."""
        self._last = None

    def brake(
        self,
        seen: Observation,
        now: Observation,
        thrusts: Thrusts,
        weather: Weather,
        keeper: StationKeeper,
    ) -> Thrusts:
        """Return the thrusts that brake the boat, and none once it must have stopped. The boat was
        last `seen` then, and has had `thrusts` since the last call.
        """
        since, state = self._last or (seen.time_s, seen.state)
        state = dead_reckoned(keeper.vessel, state, thrusts, weather, now.time_s - since)
        self._last = (now.time_s, state)
        if state[3] < LEAST_WAY_MPS:
            return 0.0, 0.0
        return keeper.brake(state, weather)
