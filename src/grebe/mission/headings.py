"""Unwrapped headings: a compass wraps, but a controller needs a continuous heading."""

from __future__ import annotations

import math
from dataclasses import replace

from grebe.links.base import Observation


def unwrapped(observation: Observation, before: Observation | None) -> Observation:
    """Return the observation with its heading within half a turn of the previous one.

    A heading that is already within half a turn is returned unchanged, bit for bit.
    """
    if before is None:
        return observation
    north, east, heading, *velocities = observation.state
    turns = round((heading - before.state[2]) / (2 * math.pi))
    if turns == 0:
        return observation
    surge, sway, yaw_rate = velocities
    state = (north, east, heading - 2 * math.pi * turns, surge, sway, yaw_rate)
    return replace(observation, state=state)
