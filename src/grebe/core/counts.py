"""Counts as they stand in a sentence: `1 row`, `2 rows`."""

from __future__ import annotations


def counted(count: int, one: str, many: str = "") -> str:
    """A count with the word for `one`, or for `many`, which has an s where it is not given."""
    return f"{count} {one if count == 1 else many or one + 's'}"
