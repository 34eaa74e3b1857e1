"""A drive in pieces of a few seconds, each predicted from its own start.

This is multiple shooting; the starts are estimated too. Over a few seconds gusts do not yet carry
the prediction away, and its errors still depend on all of the model's parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.identification.drive_log import DriveLog

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

GRID_S = 0.05
# Half width of the time window in which a line is fitted to the measurements [s].
SMOOTHING_S = 0.4
FEWEST_ROWS = 8
# Time before the first piece, in which the effect of commands before the log decays [s].
LEAD_IN_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Segments:
    """Pieces of equal length on one uniform grid.

    `grid` (lead + stride n + 1,) [s] begins with the log and has `lead` steps, then `stride` steps
    for each of n pieces, used or not. `used` (s,) are the numbers of the pieces with enough rows;
    `steps` of each are predicted.
    For each row of the log in a used piece, `rows` is its number in the log, `piece` the index of
    its piece in `used`, `step` its grid step within the piece, and `share` its position in the
    step, from 0 to 1.
    """

    grid: Array
    lead: int
    stride: int
    steps: int
    used: NDArray[np.int64]
    rows: NDArray[np.int64]
    piece: NDArray[np.int64]
    step: NDArray[np.int64]
    share: Array

    def choose(self, keep: NDArray[np.bool_]) -> Segments:
        """The used pieces marked in `keep` (len(used),)."""
        place = np.cumsum(keep) - 1
        rows = keep[self.piece]
        return replace(
            self,
            used=self.used[keep],
            rows=self.rows[rows],
            piece=place[self.piece[rows]],
            step=self.step[rows],
            share=self.share[rows],
        )

    def first(self, share: float) -> Segments:
        """The first `share` of every piece."""
        steps = max(1, round(share * self.stride))
        rows = self.step < steps
        return replace(
            self,
            steps=steps,
            rows=self.rows[rows],
            piece=self.piece[rows],
            step=self.step[rows],
            share=self.share[rows],
        )

    @property
    def begins(self) -> Array:
        """Start times (len(used),) of the used pieces [s]."""
        return self.grid[self.lead + self.used * self.stride]


def segments_of(log: DriveLog, length_s: float) -> Segments:
    """Cut a log into pieces of `length_s`; those with too few rows are left out."""
    steps, lead = round(length_s / GRID_S), round(LEAD_IN_S / GRID_S)
    known = max(log.times[0], min(log.command_times[0], log.times[-1] - 2 * length_s))
    first = known + LEAD_IN_S
    count = max(1, int((log.times[-1] - first) / (steps * GRID_S) + 0.2))
    grid = known + GRID_S * np.arange(lead + count * steps + 1)
    number = np.floor((log.times - first) / GRID_S + 1e-9).astype(np.int64)
    piece_of = np.where(number < 0, count, number // steps)
    headed = np.isfinite(log.states[:, 2])
    enough = np.array(
        [int((headed & (piece_of == piece)).sum()) >= FEWEST_ROWS for piece in range(count)]
    )
    used = np.flatnonzero(enough)
    if len(used) < 2:
        raise InputError(
            f"{log.name}: only {len(used)} pieces of {length_s:g} s hold {FEWEST_ROWS} rows; log "
            "the state ten times a second."
        )
    place = np.full(count + 1, -1)
    place[used] = np.arange(len(used))
    rows = np.flatnonzero(place[np.minimum(piece_of, count)] >= 0)
    step = number[rows] - piece_of[rows] * steps
    share = (log.times[rows] - grid[lead + number[rows]]) / GRID_S
    return Segments(
        grid=grid,
        lead=lead,
        stride=steps,
        steps=steps,
        used=used,
        rows=rows,
        piece=place[piece_of[rows]],
        step=step,
        share=np.clip(share, 0.0, 1.0),
    )


def smoothed_states(log: DriveLog, instants: Array) -> Array:
    """States (s, 6) at some times, by lines fitted to the measurements around each.

    Velocities that were not measured follow from the slopes of positions and headings.
    """
    out = np.zeros((len(instants), 6))
    for i, instant in enumerate(instants.tolist()):
        near = np.abs(log.times - instant) <= SMOOTHING_S
        level, slope = np.zeros(6), np.zeros(6)
        for channel in range(6):
            level[channel], slope[channel] = _line(log, near, channel, instant)
        cos, sin = np.cos(level[2]), np.sin(level[2])
        surge = cos * slope[0] + sin * slope[1]
        sway = cos * slope[1] - sin * slope[0]
        instead = np.array([0.0, 0.0, 0.0, surge, sway, slope[2]])
        out[i] = np.where(np.isfinite(level), level, np.nan_to_num(instead))
    return out


def _line(
    log: DriveLog, near: NDArray[np.bool_], channel: int, instant: float
) -> tuple[float, float]:
    """Level and slope of a line through a channel at a time; NaN and 0 if it has no values."""
    values = log.states[near, channel]
    known = np.isfinite(values)
    if not known.any():
        return _nearest(log, channel, instant), 0.0
    if known.sum() < 3:
        return float(values[known].mean()), 0.0
    slope, level = np.polyfit(log.times[near][known] - instant, values[known], 1)
    return float(level), float(slope)


def _nearest(log: DriveLog, channel: int, instant: float) -> float:
    known = np.flatnonzero(np.isfinite(log.states[:, channel]))
    if len(known) == 0:
        return float("nan")
    return float(np.interp(instant, log.times[known], log.states[known, channel]))
