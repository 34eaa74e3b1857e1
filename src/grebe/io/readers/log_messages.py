"""The messages of an ArduPilot log, telemetry (.tlog) or DataFlash (.bin), by pymavlink."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from grebe.core.errors import InputError

LOG_SUFFIXES = (".tlog", ".bin")


def messages_in(path: Path, kinds: list[str]) -> Iterator[Any]:
    """Yield the messages of some kinds, in the order of the log.

    `InputError` says that pymavlink is missing, or that the file is not such a log.
    """
    try:
        from pymavlink import DFReader, mavutil
    except ImportError:
        raise InputError(
            f"{path}: reading an autopilot's log needs pymavlink; install grebe with its extra "
            "'mavlink'."
        ) from None
    try:
        if path.suffix.lower() == ".bin":
            log: Any = DFReader.DFReader_binary(str(path))
        else:
            log = mavutil.mavlogfile(str(path))
    except Exception as error:
        raise InputError(f"{path} is not an ArduPilot log ({error}).") from None
    try:
        while True:
            message: Any = log.recv_match(type=kinds)
            if message is None:
                return
            yield message
    except (ValueError, TypeError, LookupError, AttributeError, OSError) as error:
        raise InputError(f"{path} is damaged, or not an ArduPilot log ({error}).") from None
    finally:
        getattr(log, "close", lambda: None)()
