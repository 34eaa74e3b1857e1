"""Python's collector of circles of records, and when it is only in the way."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Generator[None]:
    """Let the collector wait: it walks over all records again whenever there are a quarter more,
    and finds nothing where none of them refer to each other in a circle, as a plan's, or where all
    are kept, as a compiler's.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@contextmanager
def no_long_pauses() -> Generator[None]:
    """Spare the loop the collector's walks over all that was imported and compiled: each takes
    some 100 ms, in which the boat hears nothing. What a mission makes itself is collected still.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def leave_all() -> None:
    """Let nothing that is there now be collected: the process ends, and all goes with it."""
    gc.freeze()
