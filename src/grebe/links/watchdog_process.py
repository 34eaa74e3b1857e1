"""The watchdog's own process: it stops a boat whose mission has died or hangs.

`grebe.mission.safety.watchdog` starts this script with the standard library alone, so that it is
small and shares only a pipe with the mission. Its standard input brings one line, the charge, in
JSON::

    {"action": "MODULE:FUNCTION" or "FILE.py:FUNCTION", "settings": {...}, "patience_s": 2.0,
     "path": [...], "journal": "FILE" or null}

It answers "ready" and a newline once it has the action, or one line that says why it has not. After
that every byte is a sign of life, and "q" is a goodbye. The first sign means that the boat has its
first command; before that there is nothing to stop. If no sign comes for `patience_s`, or the pipe
ends without a goodbye, FUNCTION is called with the settings until it returns without an error, at
most `TRIES` times.
"""

import importlib
import json
import os
import runpy
import select
import sys
import time
from collections.abc import Callable
from typing import Any

GOODBYE = b"q"
# The number of attempts at an action that fails, and the time between two of them [s].
TRIES = 20
BETWEEN_S = 0.5

Action = Callable[..., object]


def main() -> None:
    """Take the charge, watch, and act; a mission that only hung is watched again afterwards."""
    charge = json.loads(_first_line())
    try:
        sys.path[:] = charge["path"]
        action = _found(charge["action"])
    except BaseException as error:  # what is imported may raise anything
        _answer(f"{type(error).__name__}: {error}")
        return
    _answer("ready")
    # Waits for the first sign, and after an action for that of a mission that only hung.
    while _sign() not in (b"", GOODBYE):
        why = _watch(charge["patience_s"])
        if why is None:
            return
        _note(charge["journal"], why, _act(action, charge["settings"]))
        if why == DIED:
            return


DIED = "the mission's process ended without signing off"


def _watch(patience_s: float) -> str | None:
    """Wait for a reason to act and return it; None for a goodbye."""
    while True:
        ready, _, _ = select.select([0], [], [], patience_s)
        if not ready:
            return f"the mission gave no sign of life for {patience_s:g} s"
        sign = _sign()
        if not sign:
            return DIED
        if sign == GOODBYE:
            return None


def _sign() -> bytes:
    """Return the next sign of life; empty if the pipe has ended."""
    return os.read(0, 1)


def _act(action: Action, settings: dict[str, Any]) -> str:
    """Run the action, again if it fails, and return the outcome in words."""
    failure = ""
    for _ in range(TRIES):
        try:
            action(**settings)
        except Exception as error:
            failure = f"{type(error).__name__}: {error}"
            time.sleep(BETWEEN_S)
        else:
            return "the boat was stopped"
    return f"the boat could NOT be stopped ({failure})"


def _found(action: str) -> Action:
    """Return the function that MODULE:FUNCTION or FILE.py:FUNCTION names."""
    home, _, name = action.rpartition(":")
    if home.endswith(".py"):
        return runpy.run_path(home)[name]
    return getattr(importlib.import_module(home), name)


def _note(journal: str | None, why: str, outcome: str) -> None:
    """Write a line for the operator who resumes the mission: unix time, then what happened."""
    if journal is None:
        return
    try:
        with open(journal, "a", encoding="utf-8") as file:  # noqa: PTH123 - pathlib is not needed
            file.write(f"{time.time():.3f} {why}; {outcome}\n")
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        pass  # the boat is stopped, which is what counts


def _first_line() -> bytes:
    """Read the charge byte by byte, because the bytes after it are signs of life."""
    line = b""
    while not line.endswith(b"\n"):
        byte = os.read(0, 1)
        if not byte:
            sys.exit(1)
        line += byte
    return line


def _answer(text: str) -> None:
    os.write(1, " ".join(text.split()).encode() + b"\n")
    os.close(1)


if __name__ == "__main__":
    main()
