"""Prediction of a drive's measurements for many candidate boats and days at once.

The equations are those of `grebe.core.dynamics`, on arrays (candidates, pieces).
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from grebe.core.dynamics import rates, rk4
from grebe.core.vessel import Vessel
from grebe.identification.drive_log import DriveLog
from grebe.identification.parameters import DRAGS, MASSES, Candidate
from grebe.identification.segments import GRID_S, Segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def predict(
    log: DriveLog, segments: Segments, candidates: Sequence[Candidate], starts: Array
) -> Array:
    """Predict the measurements (c, n, 6) of the rows in `segments`; commands are throttles.

    `starts` (c, s, 6) are the true states at which the used pieces begin. Only the result contains
    the compass's error.
    """
    # Substeps that keep the fastest decay of the stiffest candidate stable.
    fastest = max(one.vessel.fastest_rate_hz for one in candidates)
    substeps = max(1, int(np.ceil(GRID_S * fastest)))
    hull = _side_by_side(candidates)
    weather = list(np.array([one.weather for one in candidates]).T[:, :, None])
    thrusts = _thrusts(log, segments, candidates)
    state = list(np.moveaxis(starts, -1, 0))
    course = np.empty((segments.steps + 1, 6, *starts.shape[:2]))
    course[0] = state
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(segments.steps):
            inputs = thrusts[:, :, k, 0], thrusts[:, :, k, 1]
            state = rk4(
                lambda z, inputs=inputs: rates(hull, z, inputs, weather, cos=np.cos, sin=np.sin),
                state,
                GRID_S,
                substeps,
            )
            course[k + 1] = state
    shown = _at_rows(course, segments)
    return _as_measured(shown, np.array([one.compass_rad for one in candidates]))


def _side_by_side(candidates: Sequence[Candidate]) -> Vessel:
    """The candidates' parameters as columns (c, 1) under a vessel's names.

    The result replaces a `Vessel` in equations that only multiply and add.
    """
    names = (*MASSES, *DRAGS, "arm_m", "yaw_coupling_kg")
    columns = {
        name: np.array([[getattr(one.vessel, name)] for one in candidates]) for name in names
    }
    return cast("Vessel", SimpleNamespace(**columns))


def _thrusts(log: DriveLog, segments: Segments, candidates: Sequence[Candidate]) -> Array:
    """Mean thrusts (c, s, k, 2) [N] over the steps of the used pieces."""
    known: dict[object, Array] = {}
    for one in candidates:
        if one.thrusters not in known:
            means = one.thrusters.mean_thrusts(log.command_times, log.commands, segments.grid)
            pieces = means[segments.lead :].reshape(-1, segments.stride, 2)
            known[one.thrusters] = pieces[segments.used, : segments.steps]
    return np.stack([known[one.thrusters] for one in candidates])


def _at_rows(course: Array, segments: Segments) -> Array:
    """States (c, n, 6) at the times of the rows, interpolated between steps (k + 1, 6, c, s)."""
    before = course[segments.step, :, :, segments.piece]
    after = course[np.minimum(segments.step + 1, segments.steps), :, :, segments.piece]
    share = segments.share[:, None, None]
    return np.transpose(before + share * (after - before), (2, 0, 1))


def _as_measured(states: Array, compass_rad: Array) -> Array:
    """States as measured with the compass's error, which rotates heading, surge and sway."""
    out = states.copy()
    turn = compass_rad[:, None]
    out[..., 2] += turn
    cos, sin = np.cos(turn), np.sin(turn)
    out[..., 3] = cos * states[..., 3] + sin * states[..., 4]
    out[..., 4] = cos * states[..., 4] - sin * states[..., 3]
    return out
