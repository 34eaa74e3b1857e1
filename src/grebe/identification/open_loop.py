"""Open-loop predictions, without the measurements: the relevant test, as a plan does the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.identification.drive_log import DriveLog
from grebe.identification.estimator import Fit
from grebe.identification.parameters import Candidate
from grebe.identification.prediction import predict
from grebe.identification.result import Course, HoldOut
from grebe.identification.segments import Segments, segments_of, smoothed_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

HORIZON_S = 5.0
# Length of the end of a piece, over which its drift is measured [s].
END_S = 0.5


def tried(
    log: DriveLog, pieces: Segments, held: NDArray[np.bool_], fit: Fit, preset: Candidate
) -> HoldOut:
    """Predict the pieces marked in `held` (s,) with a fit that has not seen them."""
    windows = _windows(log, pieces, held)
    fitted = fit.model.candidate(fit.theta)
    errors = [_errors(log, windows, one) for one in (fitted, preset)]
    late = windows.step * 1.0 >= windows.steps * (1 - END_S / HORIZON_S)
    drifts = [float(np.sqrt(np.nanmean(np.sum(one[late, :2] ** 2, axis=1)))) for one in errors]
    return HoldOut(
        horizon_s=HORIZON_S,
        pieces=len(windows.used),
        fitted=_rms(errors[0][:, 3:]),
        preset=_rms(errors[1][:, 3:]),
        fitted_drift_m=drifts[0],
        preset_drift_m=drifts[1],
        noise=fit.noise[3:],
    )


def course_of(log: DriveLog, pieces: Segments, held: NDArray[np.bool_], fit: Fit) -> Course:
    """Predict every piece, one horizon after the other."""
    windows = segments_of(log, HORIZON_S)
    predicted = _shown(log, windows, fit.model.candidate(fit.theta))
    begins = np.concatenate([[True], np.diff(windows.piece) > 0])
    seconds = log.times[windows.rows] - log.times[0]
    return Course(
        times=seconds,
        measured=log.states[windows.rows, 3:],
        predicted=predicted[:, 3:],
        begins=begins,
        held_out=_within(log.times[windows.rows], pieces, held),
    )


def _windows(log: DriveLog, pieces: Segments, held: NDArray[np.bool_]) -> Segments:
    """Pieces of one horizon that are entirely within the held-out pieces, if there are any."""
    windows = segments_of(log, HORIZON_S)
    edge = 1e-3
    first = _within(windows.begins + edge, pieces, held)
    last = _within(windows.begins + HORIZON_S - edge, pieces, held)
    chosen = first & last
    return windows.choose(chosen if chosen.any() else first | last | ~chosen)


def _within(times: Array, pieces: Segments, held: NDArray[np.bool_]) -> NDArray[np.bool_]:
    begins = pieces.begins[held]
    length = pieces.stride * (pieces.grid[1] - pieces.grid[0])
    inside = (times[:, None] >= begins - 1e-9) & (times[:, None] < begins + length)
    return np.asarray(inside.any(axis=1))


def _shown(log: DriveLog, windows: Segments, one: Candidate) -> Array:
    """Predicted measurements (n, 6) from smoothed starts, corrected for the compass."""
    starts = smoothed_states(log, windows.begins)
    turn = one.compass_rad
    surge, sway = starts[:, 3].copy(), starts[:, 4].copy()
    starts[:, 2] -= turn
    starts[:, 3] = np.cos(turn) * surge - np.sin(turn) * sway
    starts[:, 4] = np.cos(turn) * sway + np.sin(turn) * surge
    return predict(log, windows, [one], starts[None])[0]


def _errors(log: DriveLog, windows: Segments, one: Candidate) -> Array:
    return log.states[windows.rows] - _shown(log, windows, one)


def _rms(errors: Array) -> Array:
    known = np.isfinite(errors)
    squares = np.where(known, errors, 0.0) ** 2
    return np.sqrt(squares.sum(axis=0) / np.maximum(known.sum(axis=0), 1))
