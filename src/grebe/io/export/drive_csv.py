"""Write a drive as it happens: rows of states and rows of commands, each flushed at once.

`grebe.io.readers.drive_csv` reads it back. Commands are throttles, -1 to 1: what the actuators get,
whatever thrust curve the vessel is assumed to have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Self, TextIO

from grebe.core.errors import InputError
from grebe.core.events import State

HEADER = (
    "time_s,north_m,east_m,heading_deg,surge_mps,sway_mps,yaw_rate_degps,"
    "throttle_port,throttle_starboard"
)


class DriveCsv:
    """An open log of a drive; use it in a `with` statement. `InputError` names its path."""

    def __init__(self, path: Path, *, force: bool = False) -> None:
        self._path = path
        if path.exists() and not force:
            raise InputError(
                f"{path} exists already; give another name, or replace it by force.",
                settings=("force",),
            )
        try:
            self._file: TextIO = path.open("w", encoding="utf-8")
        except OSError as error:
            raise self._unwritten(error) from None
        self._line(HEADER)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._file.close()
        except OSError as error:
            raise self._unwritten(error) from None

    def state(self, time_s: float, state: State) -> None:
        """Write a state estimate; NaN is left empty."""
        north, east, heading, surge, sway, yaw_rate = state
        cells = (
            f"{north:.4f}",
            f"{east:.4f}",
            f"{math.degrees(heading):.5f}",
            f"{surge:.5f}",
            f"{sway:.5f}",
            f"{math.degrees(yaw_rate):.5f}",
        )
        known = ("" if cell == "nan" else cell for cell in cells)
        self._line(f"{time_s:.4f},{','.join(known)},,")

    def command(self, time_s: float, throttles: Sequence[float]) -> None:
        """Write the throttles of port and starboard that hold from now on."""
        self._line(f"{time_s:.4f},,,,,,,{throttles[0]:.6f},{throttles[1]:.6f}")

    def _line(self, text: str) -> None:
        try:
            self._file.write(text + "\n")
            self._file.flush()
        except OSError as error:
            raise self._unwritten(error) from None

    def _unwritten(self, error: OSError) -> InputError:
        return InputError(f"{self._path} cannot be written: {error.strerror}.")
