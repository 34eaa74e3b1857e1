"""Samples: the sonde's readings, their positions, and a quality flag for each value.

`Sample` is one reading, as a mission takes it. `Samples` holds many as columns: the survey file
returns them, and quality control, lag correction, maps and report use them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Flag:
    """QARTOD flags, the numbers stored beside every value."""

    GOOD = 1
    NOT_EVALUATED = 2
    SUSPECT = 3
    FAIL = 4
    MISSING = 9
    USABLE = (GOOD, NOT_EVALUATED)


# After a pause this long [s], another outing begins.
LONG_PAUSE_S = 12 * 3600.0


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One reading of the sonde with the position where it was taken.

    `speed_mps` is the surge over ground, the u of the speed window. `values` and `flags`
    are keyed by quantity; a missing value is None and flagged 9.
    """

    time: datetime
    north_m: float
    east_m: float
    target_seq: int | None
    speed_mps: float | None
    values: Mapping[str, float | None]
    flags: Mapping[str, int]


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Many samples as columns.

    `times` (n,) unix seconds, UTC; `positions` (n, 2) north, east [m] in the survey's frame;
    `target_seq` (n,) the target that each was taken in, 0 for none; `speed_mps` (n,) surge over
    ground, NaN where unknown; `values` (n,) by quantity, in its unit, NaN for missing; `flags`
    (n,) by quantity, see `Flag`; `boat` (n,) the number of the boat that took each, None if one
    boat took them all. Raises `InputError` if columns differ in length, or if a quantity has
    values without flags or flags without values.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    target_seq: NDArray[np.int64]
    speed_mps: NDArray[np.float64]
    values: Mapping[str, NDArray[np.float64]]
    flags: Mapping[str, NDArray[np.int64]]
    boat: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        n = len(self.times)
        if self.positions.shape != (n, 2):
            raise InputError(f"{n} samples have positions of shape {self.positions.shape}.")
        columns = {"target_seq": self.target_seq, "speed_mps": self.speed_mps, **self.values}
        if self.boat is not None:
            columns["boat"] = self.boat
        for name, column in columns.items():
            if column.shape != (n,):
                raise InputError(f"{n} samples have {name} of shape {column.shape}.")
        if set(self.values) != set(self.flags):
            odd = sorted(set(self.values) ^ set(self.flags))
            raise InputError(f"Samples have values or flags, but not both, of {', '.join(odd)}.")
        for key, column in self.flags.items():
            if column.shape != (n,):
                raise InputError(f"{n} samples have flags of {key} of shape {column.shape}.")

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def of(
        cls,
        *,
        times: NDArray[np.float64],
        positions: NDArray[np.float64],
        values: Mapping[str, NDArray[np.float64]],
        quantities: Quantities,
        speed_mps: NDArray[np.float64] | None = None,
    ) -> Samples:
        """Samples that belong to no plan, flagged by the gross range of their quantities alone."""
        n = len(times)
        return cls(
            times=times,
            positions=positions,
            target_seq=np.zeros(n, dtype=np.int64),
            speed_mps=np.full(n, np.nan) if speed_mps is None else speed_mps,
            values=values,
            flags={
                key: gross_range_flags(column, quantities.known(key).span)
                for key, column in values.items()
            },
        )

    def moment(self, index: int) -> datetime:
        """Time of one sample, UTC."""
        return datetime.fromtimestamp(float(self.times[index]), UTC)

    def measured(self, key: str) -> bool:
        """Whether any value of a quantity is present."""
        return key in self.values and bool(np.isfinite(self.values[key]).any())

    def usable(self, key: str) -> NDArray[np.bool_]:
        """Mask (n,) of the values that are present and not flagged suspect or failed."""
        return np.isfinite(self.values[key]) & np.isin(self.flags[key], Flag.USABLE)

    def outings(self) -> tuple[int, float]:
        """How many outings the samples are of, and the longest pause between two [s]."""
        pauses = np.diff(np.sort(self.times))
        long = pauses[pauses > LONG_PAUSE_S]
        return 1 + len(long), float(long.max(initial=0.0))

    def rows(self, index: NDArray[np.int64] | NDArray[np.bool_] | slice) -> Samples:
        """Some of the samples."""
        return Samples(
            times=self.times[index],
            positions=self.positions[index],
            target_seq=self.target_seq[index],
            speed_mps=self.speed_mps[index],
            values={key: column[index] for key, column in self.values.items()},
            flags={key: column[index] for key, column in self.flags.items()},
            boat=None if self.boat is None else self.boat[index],
        )

    def each_boat(self) -> list[NDArray[np.int64]]:
        """Indices of each boat's samples, one array per boat."""
        if self.boat is None:
            return [np.arange(len(self))]
        return [np.flatnonzero(self.boat == number) for number in np.unique(self.boat)]

    def of_boat(self, number: int) -> Samples:
        """Samples of one boat; without boat numbers, all belong to boat 1."""
        whose = np.ones(len(self), dtype=np.int64) if self.boat is None else self.boat
        return self.rows(whose == number)

    def moved(self, positions: NDArray[np.float64]) -> Samples:
        """The same samples with their positions (n, 2) in another frame."""
        return replace(self, positions=positions)

    def with_values(self, values: Mapping[str, NDArray[np.floating]]) -> Samples:
        """The same samples with the values of some quantities replaced."""
        more = {key: column.astype(np.float64) for key, column in values.items()}
        return replace(self, values={**self.values, **more})


def gross_range_flag(value: float | None, span: tuple[float, float]) -> int:
    """Flag a value by QARTOD's gross range test: good, failed, or missing."""
    if value is None or not math.isfinite(value):
        return Flag.MISSING
    return Flag.GOOD if span[0] <= value <= span[1] else Flag.FAIL


def gross_range_flags(values: NDArray[np.float64], span: tuple[float, float]) -> NDArray[np.int64]:
    """Flag values (n,) as `gross_range_flag` does one."""
    inside = (values >= span[0]) & (values <= span[1])
    flags = np.where(inside, Flag.GOOD, Flag.FAIL)
    return np.where(np.isfinite(values), flags, Flag.MISSING).astype(np.int64)
