"""The tables of a survey file besides its plan, and the form of samples in its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import compress
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import shapely

from grebe.core.events import State, Step
from grebe.core.frames import LocalFrame
from grebe.core.quantities import Quantities
from grebe.core.revision import Sortie
from grebe.core.samples import Flag, Sample, Samples
from grebe.io.store import geopackage
from grebe.io.store.schema import STATE_COLUMNS
from grebe.io.store.timestamps import parse_time, parse_times, time_text, time_texts

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Rows are turned into columns, and columns into rows, in blocks of this many, to bound memory.
ROWS_AT_ONCE = 50_000


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a survey has come: when each target was reached (None: not yet)."""

    reached_at: tuple[datetime | None, ...]
    sample_counts: tuple[int, ...]

    @property
    def reached(self) -> int:
        """Number of reached targets."""
        return sum(moment is not None for moment in self.reached_at)

    def reached_in(self, sortie: Sortie) -> int:
        """Number of a sortie's targets that are reached."""
        own = self.reached_at[sortie.first - 1 : sortie.last]
        return sum(moment is not None for moment in own)


@dataclass(frozen=True, kw_only=True)
class TrackEnd:
    """One end of the recorded track: the state (6,) there, and when."""

    time: datetime
    state: State


@dataclass(frozen=True, kw_only=True)
class TrackTable:
    """The complete track as columns.

    `seconds` since the first row, `states` (n, 6), `thrusts` (n, 2) [N], `solve_ms` (n,), `status`
    (n,), `boat` (n,) by its number in the fleet.
    """

    times: tuple[datetime, ...]
    seconds: NDArray[np.float64]
    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]
    solve_ms: NDArray[np.float64]
    status: tuple[str, ...]
    target_seq: NDArray[np.int64]
    boat: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.states)

    def each_boat(self) -> list[TrackTable]:
        """Return the tracks of the boats, the one with the lowest number first."""
        return [self.of_boat(number) for number in np.unique(self.boat).tolist()]

    def of_boat(self, number: int) -> TrackTable:
        """Return the track of one boat."""
        return self._rows(self.boat == number)

    def _rows(self, chosen: NDArray[np.bool_]) -> TrackTable:
        return TrackTable(
            times=tuple(compress(self.times, chosen)),
            seconds=self.seconds[chosen],
            states=self.states[chosen],
            thrusts=self.thrusts[chosen],
            solve_ms=self.solve_ms[chosen],
            status=tuple(compress(self.status, chosen)),
            target_seq=self.target_seq[chosen],
            boat=self.boat[chosen],
        )


def track_row(point: Step, place: bytes, boat: int) -> dict[str, Any]:
    """Return a step of a boat as a row of the track; `place` is its point as the file stores it."""
    return {
        "geom": place,
        "time": time_text(point.time),
        **dict(zip(STATE_COLUMNS, point.state, strict=True)),
        "thrust_port_n": point.thrusts[0],
        "thrust_starboard_n": point.thrusts[1],
        "target_seq": point.target_seq,
        "split_stage": point.split_stage,
        "solve_ms": point.solve_ms,
        "status": point.status,
        "current_north_mps": point.current_north_mps,
        "current_east_mps": point.current_east_mps,
        "boat": boat,
    }


def track_of(rows: Sequence[tuple[Any, ...]]) -> TrackTable:
    """Return the track from its rows.

    A row holds time, status, target, boat, the state, both thrusts, and ms of the solver.
    """
    times = tuple(parse_time(row[0]) for row in rows)
    numbers = np.array([row[4:] for row in rows], dtype=float).reshape(-1, 9)
    return TrackTable(
        times=times,
        seconds=np.array([(t - times[0]).total_seconds() for t in times]),
        states=numbers[:, :6],
        thrusts=numbers[:, 6:8],
        solve_ms=numbers[:, 8],
        status=tuple(row[1] or "" for row in rows),
        target_seq=np.array([row[2] or 0 for row in rows], dtype=np.int64),
        boat=np.array([row[3] for row in rows], dtype=np.int64),
    )


def sample_columns(quantities: Quantities) -> list[str]:
    """Return the columns of the table of samples, as SQL names them."""
    pairs = [name for key in quantities for name in (f'"{key}"', f'"{key}_qc"')]
    return ["geom", "time", "target_seq", "speed_mps", "boat", *pairs]


def row_of(sample: Sample, frame: LocalFrame, quantities: Quantities, boat: int) -> tuple[Any, ...]:
    """Return one sample of a boat as a row of `sample_columns`."""
    place = frame.to_wgs84((sample.north_m, sample.east_m)).tolist()
    pairs = [
        cell
        for key in quantities
        for cell in (sample.values.get(key), sample.flags.get(key, Flag.MISSING))
    ]
    blob = geopackage.to_blob(shapely.Point(place))
    return blob, time_text(sample.time), sample.target_seq, sample.speed_mps, boat, *pairs


def rows_of(
    samples: Samples, frame: LocalFrame, quantities: Quantities
) -> Iterator[tuple[Any, ...]]:
    """Return columns of samples as rows of `sample_columns`; SQLite stores NaN as NULL."""
    n = len(samples)
    points = cast("NDArray[np.object_]", shapely.points(frame.to_wgs84(samples.positions)))
    columns: list[Sequence[Any]] = [
        geopackage.to_blobs(points),
        time_texts(samples.times),
        [seq or None for seq in samples.target_seq.tolist()],
        samples.speed_mps.tolist(),
        [1] * n if samples.boat is None else samples.boat.tolist(),
    ]
    for key in quantities:
        known = key in samples.values
        columns.append(samples.values[key].tolist() if known else [None] * n)
        columns.append(samples.flags[key].tolist() if known else [Flag.MISSING] * n)
    return zip(*columns, strict=True)


def samples_of(
    blocks: Iterator[list[tuple[Any, ...]]], frame: LocalFrame, quantities: Quantities
) -> Samples:
    """Return rows of `sample_columns`, in blocks, as columns."""
    width = 3 + 2 * len(quantities)
    parts = [_block(rows, width) for rows in blocks]
    parts = parts or [_block([], width)]
    times, lonlat, numbers = (np.concatenate(one) for one in zip(*parts, strict=True))
    flags = np.nan_to_num(numbers[:, 4::2], nan=Flag.MISSING).astype(np.int64)
    boat = numbers[:, 2].astype(np.int64)
    return Samples(
        times=times,
        positions=frame.to_local(lonlat),
        target_seq=np.nan_to_num(numbers[:, 0]).astype(np.int64),
        speed_mps=numbers[:, 1],
        values={key: numbers[:, 3 + 2 * i] for i, key in enumerate(quantities)},
        flags={key: flags[:, i] for i, key in enumerate(quantities)},
        boat=boat if len(np.unique(boat)) > 1 else None,
    )


def _block(
    rows: list[tuple[Any, ...]], width: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times (n,), longitudes and latitudes (n, 2), and other columns (n, width) of rows."""
    return (
        parse_times([row[1] for row in rows]),
        geopackage.point_coordinates([row[0] for row in rows]),
        np.array([row[2:] for row in rows], dtype=float).reshape(len(rows), width),
    )
