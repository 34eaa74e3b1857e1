"""The simulated sonde: readings of the true water, with noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from grebe.simulation.water import Water


class ReadsWater(Protocol):
    """Interface of a simulated sonde."""

    def read(self, north_m: float, east_m: float) -> Mapping[str, float]:
        """Return a reading at a place, keyed by quantity."""
        ...


@dataclass(frozen=True, kw_only=True)
class UniformSonde:
    """A sonde that reads the same everywhere, for trials in which only sample positions matter."""

    values: Mapping[str, float] = field(default_factory=lambda: {"temperature_degc": 20.0})

    def read(self, north_m: float, east_m: float) -> Mapping[str, float]:  # noqa: ARG002
        """See `ReadsWater`."""
        return self.values


class Sonde:
    """A sonde that reads the true water with the noise of `Water`, repeatably for a given seed."""

    def __init__(self, water: Water, seed: int) -> None:
        self._water = water
        self._rng = np.random.default_rng(seed)

    def read(self, north_m: float, east_m: float) -> dict[str, float]:
        """Return a reading of every quantity that the water has."""
        place = np.array([[north_m, east_m]])
        return {
            key: float(self._water.value(key, place)[0] + self._rng.normal(0.0, noise))
            for key, noise in self._water.noise_sd.items()
        }
