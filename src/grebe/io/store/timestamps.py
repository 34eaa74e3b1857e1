"""Times as the survey file writes them: UTC, ISO 8601, milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LENGTH = len("2026-05-01T12:00:00.000Z")


def time_text(time: datetime) -> str:
    """Return 2026-05-01T12:00:00.000Z for an aware time."""
    if time.tzinfo is None:
        raise ValueError(f"a time without a zone: {time}")
    return time.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def time_texts(seconds: NDArray[np.float64]) -> list[str]:
    """Return unix seconds (n,) as `time_text` writes one; milliseconds are truncated."""
    fraction, whole = np.modf(seconds)
    micros = 1_000_000 * whole.astype(np.int64) + np.rint(1e6 * fraction).astype(np.int64)
    texts = np.datetime_as_string((micros // 1000).astype("datetime64[ms]"))
    return np.char.add(texts, "Z").tolist()


def parse_time(text: str) -> datetime:
    """Read a time as `time_text` writes it."""
    return datetime.fromisoformat(text)


def parse_times(texts: Sequence[str]) -> NDArray[np.float64]:
    """Read times to unix seconds (n,), all at once if they are as `time_text` writes them."""
    if all(len(text) == _LENGTH and text.endswith("Z") for text in texts):
        stamps = np.array([text[:-1] for text in texts], dtype="datetime64[ms]")
        return stamps.astype(np.int64) / 1000.0
    return np.array([parse_time(text).timestamp() for text in texts], dtype=float)
