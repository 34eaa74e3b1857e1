"""What a survey file hands out besides its plan, and how samples stand in its rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import shapely

from grebe.core.events import State
from grebe.core.frames import LocalFrame
from grebe.core.quantities import Quantities
from grebe.core.samples import Flag, Sample, Samples
from grebe.io.store import geopackage
from grebe.io.store.timestamps import parse_times, time_text, time_texts

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a survey has come: when each target was reached (None: not yet)."""

    reached_at: tuple[datetime | None, ...]
    sample_counts: tuple[int, ...]

    @property
    def reached(self) -> int:
        """Number of reached targets."""
        return sum(moment is not None for moment in self.reached_at)


@dataclass(frozen=True, kw_only=True)
class TrackEnd:
    """One end of the recorded track: the state (6,) there, and when."""

    time: datetime
    state: State


@dataclass(frozen=True, kw_only=True)
class TrackTable:
    """The whole track as columns: `seconds` since the first row, `states` (n, 6),
    `thrusts` (n, 2) [N], `solve_ms` (n,), `status` (n,).
    """

    times: tuple[datetime, ...]
    seconds: NDArray[np.float64]
    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]
    solve_ms: NDArray[np.float64]
    status: tuple[str, ...]
    target_seq: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.states)


def sample_columns(quantities: Quantities) -> list[str]:
    """The columns of the table of samples, as SQL names them."""
    pairs = [name for key in quantities for name in (f'"{key}"', f'"{key}_qc"')]
    return ["geom", "time", "target_seq", "speed_mps", *pairs]


def row_of(sample: Sample, frame: LocalFrame, quantities: Quantities) -> tuple[Any, ...]:
    """One sample as a row of `sample_columns`."""
    place = frame.to_wgs84((sample.north_m, sample.east_m)).tolist()
    pairs = [
        cell
        for key in quantities
        for cell in (sample.values.get(key), sample.flags.get(key, Flag.MISSING))
    ]
    blob = geopackage.to_blob(shapely.Point(place))
    return blob, time_text(sample.time), sample.target_seq, sample.speed_mps, *pairs


def rows_of(
    samples: Samples, frame: LocalFrame, quantities: Quantities
) -> Iterator[tuple[Any, ...]]:
    """Columns of samples as rows of `sample_columns`; SQLite keeps NaN as NULL."""
    n = len(samples)
    points = cast("NDArray[np.object_]", shapely.points(frame.to_wgs84(samples.positions)))
    columns: list[Sequence[Any]] = [
        geopackage.to_blobs(points),
        time_texts(samples.times),
        [seq or None for seq in samples.target_seq.tolist()],
        samples.speed_mps.tolist(),
    ]
    for key in quantities:
        known = key in samples.values
        columns.append(samples.values[key].tolist() if known else [None] * n)
        columns.append(samples.flags[key].tolist() if known else [Flag.MISSING] * n)
    return zip(*columns, strict=True)


def samples_of(
    blocks: Iterator[list[tuple[Any, ...]]], frame: LocalFrame, quantities: Quantities
) -> Samples:
    """Rows of `sample_columns`, in blocks, as columns."""
    parts = [_block(rows, 2 + 2 * len(quantities)) for rows in blocks]
    parts = parts or [_block([], 2 + 2 * len(quantities))]
    times, lonlat, numbers = (np.concatenate(one) for one in zip(*parts, strict=True))
    flags = np.nan_to_num(numbers[:, 3::2], nan=Flag.MISSING).astype(np.int64)
    return Samples(
        times=times,
        positions=frame.to_local(lonlat),
        target_seq=np.nan_to_num(numbers[:, 0]).astype(np.int64),
        speed_mps=numbers[:, 1],
        values={key: numbers[:, 2 + 2 * i] for i, key in enumerate(quantities)},
        flags={key: flags[:, i] for i, key in enumerate(quantities)},
    )


def _block(
    rows: list[tuple[Any, ...]], width: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times (n,), longitude and latitude (n, 2) and the other columns (n, width) of some rows."""
    return (
        parse_times([row[1] for row in rows]),
        geopackage.point_coordinates([row[0] for row in rows]),
        np.array([row[2:] for row in rows], dtype=float).reshape(len(rows), width),
    )
