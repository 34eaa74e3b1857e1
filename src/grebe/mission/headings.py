"""Unwrapped headings: a compass wraps, a controller must not."""

from __future__ import annotations

import math
from dataclasses import replace

from grebe.links.base import Observation


def unwrapped(observation: Observation, before: Observation | None) -> Observation:
    """Return the observation with its heading within half a turn of the previous one.

    One that is so already is left as it is, to the last digit.
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
