"""Read a track from whatever wrote it.

This may be a GPX, an autopilot's log, NMEA sentences, Sea-Bird's .cnv, or a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from grebe.io.readers.autopilot_track import read_autopilot_track
from grebe.io.readers.gpx import read_gpx
from grebe.io.readers.log_messages import LOG_SUFFIXES
from grebe.io.readers.nmea_log import SENTENCE, read_nmea
from grebe.io.readers.seabird import is_seabird, read_seabird
from grebe.io.readers.table import Table, read_table

# This much of a file shows what it is [bytes].
_BEGINNING = 4096


def read_logged(
    path: Path, header_from: Path | None = None, columns: Sequence[str] | None = None
) -> Table:
    """Read a logger's file as a table, choosing the reader by its name and its beginning.

    `TrackError` or `InputError` says what is wrong with it. `header_from` and `columns` are as for
    `read_table`.
    """
    if path.suffix.lower() in LOG_SUFFIXES and path.is_file():
        return read_autopilot_track(path)
    beginning = _beginning(path)
    if "<gpx" in beginning:
        return read_gpx(path)
    if header_from is None and columns is None and _is_sentences(beginning):
        return read_nmea(path)
    if header_from is None and columns is None and is_seabird(path, beginning):
        return read_seabird(path)
    return read_table(path, header_from, columns)


def _beginning(path: Path) -> str:
    """Return the first characters; empty if the file is unreadable, as its reader will report."""
    try:
        with path.open("rb") as file:
            return file.read(_BEGINNING).decode("utf-8", "replace")
    except OSError:
        return ""


def _is_sentences(beginning: str) -> bool:
    """Return whether most complete lines hold a sentence."""
    lines = [line for line in beginning.splitlines()[:-1] if line.strip()]
    return bool(lines) and sum(bool(SENTENCE.search(line)) for line in lines) > len(lines) / 2
