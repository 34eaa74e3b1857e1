"""A drive in pieces of a few seconds, each of which is predicted from a start of its own.

Over a few seconds a model's prediction has not yet drifted off with every gust, and its errors
still tell of all that the model says: that is multiple shooting, whose starts are estimated too.
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
# Half of the time about an instant over which a line is laid through what was measured [s].
SMOOTHING_S = 0.4
FEWEST_ROWS = 8
# Before the first piece: time in which the thrusters forget what they were told before the log [s].
LEAD_IN_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Segments:
    """Pieces of equal length on one uniform grid.

    `grid` (lead + k s + 1,) [s] begins with the log, with a lead of some steps, and reaches over
    all pieces, used or not, k = `stride` steps each; `used` (s,) numbers of the pieces that hold
    enough; `steps` of each are predicted. Row i of the log that lies in
    a used piece: `rows` its number there, `piece` its place in `used`, `step` the grid step it lies
    in and `share` how far along.
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
        """Some of the used pieces, those marked in `keep` (len(used),)."""
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
        """Times (len(used),) at which the used pieces begin [s]."""
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
            f"{log.name}: {len(used)} pieces of {length_s:g} s hold {FEWEST_ROWS} rows; log the "
            "state ten times a second."
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
    """States (s, 6) at some instants: lines through what was measured about them.

    Velocities that were not measured follow from the positions' and headings' slopes.
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
    """Level and slope at an instant of a line through a channel; NaN and 0 where there is none."""
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
