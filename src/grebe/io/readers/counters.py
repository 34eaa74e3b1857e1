"""Times that are counted: in the unit that a header names, or in what their size tells."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Beyond any survey's seconds since 1970 are milliseconds, and beyond these micro- and nanoseconds.
SCALES = ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3))
# Names that are nothing but a unit: in capitals mS and uS are of a conductivity.
BARE = frozenset({"ms", "us", "ns", "millis", "micros"})
# A unit behind a name, `Time[ms]`, `time_boot_ms`, `TimeUS`; minutes and hours in brackets alone,
# for `time_min` may be the least, and `h` anything.
_UNIT = re.compile(
    r"(?:.*[^a-z]|.*time|.*timestamp|)(ms|msecs?|millis|milliseconds?|us|[uµμ]s|usecs?|micros"
    r"|microseconds?|ns|nsecs?|nanoseconds?)\s*[\])]?"
)
_LONGER = re.compile(r".*[\[(]\s*(min|mins|minutes?|h|hr|hrs|hours?)\s*[\])]")


def per_second(header: str) -> float | None:
    """How many of the unit that a header of times names are a second; None where it names none that
    is known, or seconds.
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
    """Whether a header names the unit that its times are counted in, and not seconds."""
    return per_second(header) is not None


def in_seconds(values: Array, header: str = "") -> Array:
    """Seconds (n,) from a count in the unit that the header names; or from seconds since 1970, and
    thousandths, millionths and less of them, which their size tells.
    """
    unit = per_second(header)
    if unit is not None:
        return values / unit
    for least, scale in SCALES:
        values = np.where(values > least, values / scale, values)
    return values
