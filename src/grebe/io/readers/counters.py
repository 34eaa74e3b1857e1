"""Times that are counted, in the unit that a header names or that their size shows."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Times larger than any seconds of a survey since 1970 are milliseconds, still larger ones micro- or
# nanoseconds. Each pair is where they begin, and how many make a second.
SCALES = ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3))
# Names that are nothing but a unit. In capitals, mS and uS are units of conductivity.
BARE = frozenset({"ms", "us", "ns", "millis", "micros"})
# A unit after a name, `Time[ms]`, `time_boot_ms`, `TimeUS`. Minutes and hours only in brackets,
# because `time_min` may be the minimum, and `h` anything.
_UNIT = re.compile(
    r"(?:.*[^a-z]|.*time|.*timestamp|)(ms|msecs?|millis|milliseconds?|us|[uµμ]s|usecs?|micros"
    r"|microseconds?|ns|nsecs?|nanoseconds?)\s*[\])]?"
)
_LONGER = re.compile(r".*[\[(]\s*(min|mins|minutes?|h|hr|hrs|hours?)\s*[\])]")


def per_second(header: str) -> float | None:
    """Return how many of the unit that a header of times names make a second.

    None if it names seconds, or no known unit.
    """
    text = header.strip().lower()
    longer = _LONGER.fullmatch(text)
    if longer is not None:
        return 1 / 60 if longer[1].startswith("m") else 1 / 3600
    found = _UNIT.fullmatch(text)
    if found is None:
        return None
    if found[1].startswith(("ms", "milli")):
        return 1e3
    return 1e9 if found[1].startswith("n") else 1e6


def is_counted(header: str) -> bool:
    """Return whether a header names the unit that its times are counted in, other than seconds."""
    return per_second(header) is not None


def in_seconds(values: Array, header: str = "") -> Array:
    """Return seconds (n,) from a count in the unit that the header names.

    Without one, the size of the numbers shows whether they are seconds since 1970, or thousandths,
    millionths or smaller fractions of them.
    """
    unit = per_second(header)
    if unit is not None:
        return values / unit
    for least, scale in SCALES:
        values = np.where(values > least, values / scale, values)
    return values
