"""Waiting for a page or a server to do something."""

from __future__ import annotations

import time


def until(holds, what, seconds=90.0):
    """Wait for a condition; a strict content policy forbids the browser's own waiting."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = holds()
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"waited {seconds:g} s in vain: {what}")
