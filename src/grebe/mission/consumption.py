"""The energy that a boat has used since it left its harbour, computed from its recorded track."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from grebe.core.dynamics import drive_power_w
from grebe.core.events import EndReason
from grebe.core.vessel import Vessel
from grebe.io.store.tables import TrackTable
from grebe.mission.safety.states import Place

# The mission ends after which a boat is where it should be.
AT_HOME = (EndReason.COMPLETE, EndReason.CAME_HOME)
# A boat within this distance of its harbour is home, where its battery is changed [m].
AT_HARBOUR_M = 15.0
# A longer gap between two rows of a track separates two missions [s].
LONGEST_ROW_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Consumption:
    """Energy [Wh] and time under way [s] since a boat was last at its harbour."""

    energy_wh: float = 0.0
    seconds: float = 0.0


NOTHING = Consumption()


def consumption_since_harbour(
    track: TrackTable, vessel: Vessel, harbour: Place, *, came_home: bool
) -> Consumption:
    """Return what a boat has spent, from its track; nothing if it came home and is at its harbour,
    but not if it only happens to be near it.

    A mission that began at the harbour began with a full battery.
    """
    away = np.hypot(*(track.states[:, :2] - np.array(harbour)).T)
    if not len(track) or (came_home and away[-1] < AT_HARBOUR_M):
        return NOTHING
    steps = np.diff(track.seconds)
    begins = np.concatenate([[0], 1 + np.flatnonzero(steps > LONGEST_ROW_S)])
    since = max((int(i) for i in begins if away[i] < AT_HARBOUR_M), default=0)
    seconds = np.clip(steps[since:], 0.0, LONGEST_ROW_S)
    seconds[steps[since:] > LONGEST_ROW_S] = 0.0
    energy = math.fsum(
        drive_power_w(vessel, thrusts, surge) * spent / 3600
        for thrusts, surge, spent in zip(
            track.thrusts[since:-1].tolist(), track.states[since:-1, 3].tolist(),
            seconds.tolist(), strict=True,
        )
    )  # fmt: skip
    return Consumption(energy_wh=energy, seconds=float(seconds.sum()))
