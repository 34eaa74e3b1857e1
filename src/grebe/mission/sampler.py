"""Measures on the way: when a reading is due, where it belongs, and what is kept of it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np
import shapely

from grebe.core.events import State
from grebe.core.quantities import Quantities
from grebe.core.samples import Sample, gross_range_flag
from grebe.core.sets import TargetSet
from grebe.core.survey import Target
from grebe.links.base import BoatLink, Observation
from grebe.mission.sampling import Sampling


class Sampler:
    """Reads a boat's sonde where its mission wants a sample."""

    def __init__(
        self,
        targets: Sequence[Target],
        link: BoatLink,
        sampling: Sampling,
        quantities: Quantities,
    ) -> None:
        self._link = link
        self._sampling, self._quantities = sampling, quantities
        self._next_s = 0.0
        self.look_for(targets)

    def look_for(self, targets: Sequence[Target]) -> None:
        """Say of samples in which of these targets they were taken."""
        self._targets = targets
        self._tree = shapely.STRtree([target.set.polygon for target in targets])

    def take(
        self, observation: Observation, time: datetime, entered: Sequence[Target], ahead: TargetSet
    ) -> Sample | None:
        """Return the sample of an estimate that entered some targets and has one ahead; None where
        none is due, none is wanted or there is no reading.
        """
        if not entered and observation.time_s < self._next_s - 1e-9:
            return None
        within = entered or self._containing(observation.state)
        if not self._sampling.keeps(observation.state[3], ahead, within):
            return None
        reading = dict(self._link.measure())
        self._next_s = observation.time_s + self._sampling.period_s
        if not reading:
            return None
        north, east, _, surge, _, _ = observation.state
        return Sample(
            time=time,
            north_m=north,
            east_m=east,
            target_seq=within[0].seq if within else None,
            speed_mps=surge,
            values=reading,
            flags={
                key: gross_range_flag(reading.get(key), one.span)
                for key, one in self._quantities.items()
            },
        )

    def _containing(self, state: State) -> list[Target]:
        point = shapely.Point(state[0], state[1])
        places = np.sort(self._tree.query(point)).tolist()
        return [t for t in (self._targets[i] for i in places) if t.set.contains(state)]
