"""NMEA 0183 sentences that a receiver wrote to a file, as a table: a row for each position."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from grebe.core.counts import counted
from grebe.core.errors import TrackError
from grebe.io.readers.table import Table
from grebe.io.readers.text import read_text

HEADER = ["time", "latitude", "longitude", "water temperature (degC)", "water depth (m)"]
# A sentence; logging programs may write a time of their own before it.
SENTENCE = re.compile(r"\$[A-Z]{2}[A-Z]{3},[^$]*\*[0-9A-Fa-f]{2}")


def read_nmea(path: Path) -> Table:
    """Read the positions of a log of sentences, with depths and temperatures.

    They are what the sounder (DPT, else DBT) and the probe (MTW) reported since the position
    before. Raises `TrackError` if no sentence gives the date, which only RMC does.
    """
    import pynmea2

    rows: list[list[str]] = []
    damaged = 0
    said = {"MTW": "", "DPT": ""}
    for text in SENTENCE.findall(read_text(path)):
        try:
            sentence: Any = pynmea2.parse(text, check=True)
        except pynmea2.ParseError:
            damaged += 1
            continue
        kind = getattr(sentence, "sentence_type", "")
        if kind == "MTW":
            said["MTW"] = str(sentence.temperature or "")
        elif kind == "DPT":
            said["DPT"] = _below_surface(sentence)
        elif kind == "DBT":
            said["DPT"] = said["DPT"] or str(sentence.depth_meters or "")
        elif kind == "RMC" and sentence.status == "A" and sentence.datestamp:
            rows.append([*_fix(sentence), said["MTW"], said["DPT"]])
            said = dict.fromkeys(said, "")
    if not rows:
        raise TrackError(
            f"{path}: no RMC sentence gives a position with its date; set the receiver to send RMC."
        )
    notes = (f"{counted(damaged, 'damaged sentence')}: left out",) if damaged else ()
    return Table(header=HEADER, rows=rows, notes=notes)


def _fix(sentence: Any) -> tuple[str, str, str]:
    """Return time, latitude, longitude."""
    return (
        sentence.datetime.isoformat(),
        f"{sentence.latitude:.8f}",
        f"{sentence.longitude:.8f}",
    )


def _below_surface(sentence: Any) -> str:
    """Return the depth [m]: below the transducer, plus the offset if that is positive."""
    try:
        return f"{float(sentence.depth) + max(float(sentence.offset or 0.0), 0.0):.2f}"
    except (TypeError, ValueError):
        return ""
