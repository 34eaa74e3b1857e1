"""Write a file completely or not at all: beside its place first, synced to the disk, then renamed.

A full disk, a crash or an interruption thus leaves the older file as it was.
"""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from grebe.core.errors import InputError

# If less room than this is left [bytes], it explains any failure to write.
NEXT_TO_NOTHING = 1_000_000

_under_way: set[Path] = set()


@contextmanager
def written_whole(
    path: Path, *failures: type[Exception], error: type[InputError] = InputError
) -> Generator[Path]:
    """Yield a temporary path to write to; at the end the file there takes `path`'s place.

    The temporary path is beside `path` and has the same suffix, for writers that go by it. If
    writing fails with an `OSError`, or with one of the writer's own `failures`, an `error` names
    `path`. However the writing ends, no part of a file is left behind.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    _under_way.add(part)
    try:
        yield part
        _onto_disk(part)
        os.replace(part, path)
    except (OSError, *failures) as failure:
        full = "the disk is full; " if _is_full(path) and not isinstance(failure, OSError) else ""
        raise error(f"{path} cannot be written: {full}{_reason(failure)}.") from None
    finally:
        _forget(part)
        _under_way.discard(part)


def forget_parts() -> None:
    """Remove the parts being written, for a process that can no longer do so itself."""
    for part in tuple(_under_way):
        _forget(part)


def write_text_whole(path: Path, text: str) -> None:
    """Write a text as UTF-8, completely or not at all; `InputError` names `path`."""
    with written_whole(path) as part:
        part.write_text(text, encoding="utf-8")


def write_rows_whole(path: Path, header: Sequence[str], rows: Iterable[Sequence[str]]) -> int:
    """Write a table as CSV, completely or not at all, and return its number of rows.

    `InputError` names `path`.
    """
    count = 0
    with written_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for row in rows:
            writer.writerow(row)
            count += 1
    return count


def _onto_disk(part: Path) -> None:
    """Sync a file: otherwise its renaming may reach the disk before its content."""
    with part.open("rb+") as file:
        os.fsync(file.fileno())


def _reason(error: Exception) -> str:
    strerror = getattr(error, "strerror", None)
    return strerror or " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__


def _is_full(path: Path) -> bool:
    """Return whether there is next to no room for a file: libraries do not always say so."""
    try:
        return shutil.disk_usage(path.parent).free < NEXT_TO_NOTHING
    except OSError:
        return False


def _forget(part: Path) -> None:
    """Remove what a writer left, with the journals that GeoPackages have beside them."""
    for suffix in ("", "-journal", "-wal", "-shm"):
        with suppress(OSError):
            part.with_name(part.name + suffix).unlink(missing_ok=True)
