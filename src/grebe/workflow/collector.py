"""Python's collector of circles of records, and when it is only in the way."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Generator[None]:
    """Let the collector wait: it walks over all records again whenever there are a quarter more,
    and finds nothing where none of them refer to each other in a circle. A plan's do not.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def leave_all() -> None:
    """Let nothing that is there now be collected: the process ends, and all goes with it."""
    gc.freeze()
