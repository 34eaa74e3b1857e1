"""Claims: the writer of a survey file keeps other writers off it; readers are not disturbed.

A claim is a lock on a separate file beside it, which the system releases when the process ends.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from grebe.core.errors import SurveyFileError


def acquire(path: Path) -> TextIO | None:
    """Claim a survey file; return None if another process has it."""
    while True:
        lock = _lock_path(path).open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            return None
        if _is_at(path, lock):
            return lock
        # The former holder dropped it and removed the file between opening and locking.
        lock.close()


def is_locked(path: Path) -> bool:
    """Return whether another process, or another part of this one, has claimed a survey file."""
    lock = _lock_path(path)
    if not lock.exists():
        return False
    try:
        taken = acquire(path)
    except OSError:
        return False
    if taken is None:
        return True
    release(path, taken)
    return False


def release(path: Path, lock: TextIO) -> None:
    """Give up a claim."""
    if _is_at(path, lock):
        _lock_path(path).unlink(missing_ok=True)
    lock.close()


@contextmanager
def locked(path: Path, why: str) -> Generator[None]:
    """Hold a claim within the block.

    Raises `SurveyFileError`, beginning with `why`, if it cannot be had.
    """
    try:
        lock = acquire(path)
    except OSError:
        raise SurveyFileError(
            f"{why}, but it is read-only; make it and its folder writable."
        ) from None
    if lock is None:
        raise SurveyFileError(
            f"{why}, but another process is writing it; open it again once that has ended."
        )
    try:
        yield
    finally:
        release(path, lock)


def _is_at(path: Path, lock: TextIO) -> bool:
    """Return whether a lock's file is the one that others will find."""
    try:
        return os.path.samestat(_lock_path(path).stat(), os.fstat(lock.fileno()))
    except OSError:
        return False


def _lock_path(path: Path) -> Path:
    """Return the path of the lock of a survey file.

    It is beside the file that `path` resolves to: one file has one lock, whatever link leads to it.
    """
    path = path.resolve()
    return path.with_name(path.name + ".lock")
