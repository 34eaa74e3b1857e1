"""Control when Python's cyclic garbage collector runs."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def without_collection() -> Generator[None]:
    """Suspend the collector within the block.

    It scans all objects again whenever their number has grown by a quarter. It finds nothing if
    they form no reference cycles, as a plan's, or if all of them are kept, as a compiler's.
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
    """Exclude everything that was imported and compiled from collection within the block.

    Each scan of it takes some 100 ms, in which the loop hears nothing from the boat. Objects that
    the mission creates are still collected.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def leave_all() -> None:
    """Exempt everything that exists now from collection, because the process is about to end."""
    gc.freeze()
