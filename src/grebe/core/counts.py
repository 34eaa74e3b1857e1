"""Counts in a sentence: `1 row`, `2 rows`."""

from __future__ import annotations


def counted(count: int, one: str, many: str = "") -> str:
    """A count with its noun: `one` for 1, else `many`, by default `one` with an s."""
    return f"{count} {one if count == 1 else many or one + 's'}"
