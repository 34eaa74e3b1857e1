"""Turn and go: a simple motion of the boat to a set, from which a solver can start.

It turns towards the centre of the set, then drives at it, and never backs up. Its states satisfy
the equations of motion, so a solver begins without gaps between them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.horizon import Plan
from grebe.core.dynamics import CALM, Weather, rates, rk4
from grebe.core.sets import TargetSet
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Largest product of a Runge-Kutta step and the boat's fastest rate; RK4 is unstable at 2.8.
SUBSTEP_STIFFNESS = 1.2


def turn_and_go(
    vessel: Vessel,
    target: TargetSet,
    state: NDArray[np.float64],
    durations: NDArray[np.float64],
    weather: Weather = CALM,
) -> Plan:
    """Return the motion from `state` (6,) towards a target, in stages of `durations` (N,) [s].

    The boat is steered as in still water and drifts with the weather.
    """
    states, thrusts = [state], []
    for duration_s in durations:
        thrusts.append(_steer(vessel, target, states[-1]))
        states.append(_predict(vessel, states[-1], thrusts[-1], float(duration_s), weather))
    return Plan(states=np.array(states), thrusts=np.array(thrusts), durations=durations)


def model_substeps(vessel: Vessel, duration_s: float) -> int:
    """Return the number of Runge-Kutta steps that the controller's model needs in a stage."""
    return max(2, math.ceil(duration_s * vessel.fastest_rate_hz / SUBSTEP_STIFFNESS))


def _steer(vessel: Vessel, target: TargetSet, state: NDArray[np.float64]) -> tuple[float, float]:
    """Thrusts that turn a boat towards the centre of a set and drive it at the window's middle."""
    north, east = target.centre
    bearing = math.atan2(east - state[1], north - state[0])
    off = math.remainder(bearing - state[2], 2 * math.pi)
    pace = 0.5 * (target.speed_min_mps + target.speed_max_mps)
    common = 0.5 * vessel.surge_drag_n(pace * max(0.0, math.cos(off)))
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    # Time constants of yaw differ tenfold between boats, so the damping depends on the boat.
    yaw = math.tanh(2.0 * (0.5 * off - 0.5 * state[5])) * 0.5 * (high - low)
    return float(np.clip(common + yaw, low, high)), float(np.clip(common - yaw, low, high))


def _predict(
    vessel: Vessel,
    state: NDArray[np.float64],
    thrusts: tuple[float, float],
    duration_s: float,
    weather: Weather,
) -> NDArray[np.float64]:
    wind = weather.as_tuple()
    substeps = model_substeps(vessel, duration_s)
    motion = rk4(lambda z: rates(vessel, z, thrusts, wind), state.tolist(), duration_s, substeps)
    return np.array(motion)
