"""Samples: what the sonde read, where, and how good each value is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

from grebe.core.errors import InputError
from grebe.core.quantities import QUANTITY_KEYS


class Flag:
    """QARTOD flags, the numbers that stand beside every value."""

    GOOD = 1
    NOT_EVALUATED = 2
    SUSPECT = 3
    FAIL = 4
    MISSING = 9
    USABLE = (GOOD, NOT_EVALUATED)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One reading of the sonde with the place where it was taken.

    `speed_mps` is the surge over ground, the u of the speed window; `values` and `flags`
    are keyed by `grebe.core.quantities`, a value that is missing is None and flagged 9.
    """

    time: datetime
    north_m: float
    east_m: float
    target_seq: int | None
    speed_mps: float | None
    values: Mapping[str, float | None]
    flags: Mapping[str, int]

    def __post_init__(self) -> None:
        unknown = (set(self.values) | set(self.flags)) - set(QUANTITY_KEYS)
        if unknown:
            raise InputError(f"A sample has unknown quantities: {', '.join(sorted(unknown))}.")


def gross_range_flag(value: float | None, span: tuple[float, float]) -> int:
    """Flag a value by QARTOD's gross range test: good, failed, or missing."""
    if value is None or not math.isfinite(value):
        return Flag.MISSING
    return Flag.GOOD if span[0] <= value <= span[1] else Flag.FAIL
