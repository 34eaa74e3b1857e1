"""Read a drive with commands from any kind of log, chosen by the file's suffix."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from grebe.core.errors import InputError
from grebe.identification.drive_log import DriveLog, unwrapped
from grebe.io.readers.autopilot_log import read_dataflash, read_telemetry
from grebe.io.readers.drive_csv import read_drive_csv
from grebe.io.store import SurveyFile

READERS = {
    ".csv": read_drive_csv,
    ".tlog": read_telemetry,
    ".bin": read_dataflash,
}


def read_drive(path: Path) -> DriveLog:
    """Return the drive of a CSV log, a survey file (.gpkg), or an ArduPilot .tlog or .bin.

    `InputError` says what is wrong with it.
    """
    suffix = path.suffix.lower()
    if suffix == ".gpkg":
        return _read_track(path)
    if suffix not in READERS:
        raise InputError(
            f"{path}: a drive is read from {', '.join(READERS)} or a survey file, .gpkg."
        )
    if not path.is_file():
        raise InputError(f"{path}: there is no such file.")
    return READERS[suffix](path)


def _read_track(path: Path) -> DriveLog:
    """Read the track of a survey file: its states, and the thrusts that hold from each state on."""
    with SurveyFile.open(path) as file:
        track = file.track()
    if len(track) == 0:
        raise InputError(f"{path} holds no track: no mission has been run from it.")
    states = track.states.copy()
    states[:, 2] = unwrapped(states[:, 2])
    ordered = np.isfinite(track.thrusts).all(axis=1)
    return DriveLog(
        name=path.name,
        times=track.seconds,
        states=states,
        command_times=track.seconds[ordered],
        commands=track.thrusts[ordered],
        unit="newton",
    )
