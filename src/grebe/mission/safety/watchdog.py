"""The watchdog: a process apart that stops the boat when the mission dies or hangs.

Where an autopilot has a time-out of its own, this is the second one. The process is started before
the boat is given its first order, holds nothing but what it needs to stop it, and belongs to no
terminal. From the first order on it hears a byte with each event of the mission, and a goodbye at
the end.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from grebe.core.errors import GrebeError, LinkError
from grebe.core.events import MissionEvent, Step
from grebe.links import guard
from grebe.links.base import BoatLink
from grebe.links.emergency import EmergencyStop, emergency_of
from grebe.mission.telling.recorders import Listener

# What the process may take to start and to import the action [s].
START_S = 20.0
# What it may take to stop a boat that answers badly, and to end [s].
END_S = 30.0


class Watchdog:
    """Guards a boat from when it is made until it is left; a listener whose events are life signs.

    `journal` is the file in which it notes what it had to do. Raises `LinkError` where the process
    does not start: a boat that nobody would stop is not set out with.
    """

    def __init__(self, stop: EmergencyStop, journal: Path | None = None) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", guard.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe, self._answer = self._process.stdin, self._process.stdout
        self._under_orders = False
        charge = {
            "action": stop.action,
            "settings": dict(stop.settings),
            "patience_s": stop.patience_s,
            "path": [str(Path(place).absolute()) for place in sys.path],
            "journal": None if journal is None else str(journal.absolute()),
        }
        answer = self._charge(json.dumps(charge).encode() + b"\n")
        if answer != "ready":
            self._process.kill()
            self._leave()
            raise LinkError(f"The watchdog that would stop the boat cannot start: {answer}.")

    def _charge(self, text: bytes) -> str:
        """Tell the process its charge, and return its answer."""
        with suppress(OSError):
            self._pipe.write(text)
            self._pipe.flush()
        os.set_blocking(self._pipe.fileno(), False)
        ready, _, _ = select.select([self._answer], [], [], START_S)
        if not ready:
            return f"it has not answered for {START_S:g} s"
        return self._answer.readline().decode().strip() or "it ended at once"

    @property
    def pid(self) -> int:
        """The process that watches."""
        return self._process.pid

    @property
    def is_there(self) -> bool:
        """Whether the process is alive."""
        return self._process.poll() is None

    def __call__(self, event: MissionEvent) -> None:
        """Give a sign of life once the boat is under orders; it never waits, and never fails."""
        self._under_orders = self._under_orders or isinstance(event, Step)
        if self._under_orders:
            self._write(b".")

    def _write(self, sign: bytes) -> None:
        # A full pipe means that the watchdog itself hangs: there is nothing to wait for.
        with suppress(OSError, ValueError):
            os.write(self._pipe.fileno(), sign)

    def dismiss(self) -> None:
        """Say goodbye: the boat has been left without thrust in good order."""
        self._write(guard.GOODBYE)
        self._leave()

    def desert(self) -> None:
        """Leave without a goodbye, and wait while the boat is stopped: nobody else may have."""
        self._leave()

    def _leave(self) -> None:
        with suppress(OSError):
            self._pipe.close()
        self._answer.close()
        try:
            self._process.wait(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # After these the mission has closed the link, and with it left the boat without thrust.
        in_order = isinstance(error, GrebeError | KeyboardInterrupt | None)
        if in_order and not isinstance(error, LinkError):
            self.dismiss()
        else:
            self.desert()


def journal_beside(path: Path) -> Path:
    """Where the watchdog of a survey file notes what it had to do."""
    return path.with_name(path.name + ".watchdog")


def taken_notes(journal: Path) -> list[str]:
    """Return what a watchdog noted since this was last asked, in words."""
    try:
        lines = journal.read_text(encoding="utf-8").splitlines()
        journal.unlink()
    except OSError:
        return []
    notes: list[str] = []
    for line in lines:
        seconds, _, what = line.partition(" ")
        with suppress(ValueError, OverflowError):
            when = datetime.fromtimestamp(float(seconds), UTC)
            notes.append(f"the watchdog acted at {when:%Y-%m-%d %H:%M:%S} UTC: {what}")
    return notes


@contextmanager
def guarded(link: BoatLink, journal: Path | None = None) -> Generator[list[Listener]]:
    """Have a link's boat watched while the mission runs; give the listeners that this takes.

    A link that offers no emergency stop is not watched. `LinkError` where the watchdog does not
    start; the caller closes the link.
    """
    stop = emergency_of(link)
    if stop is None:
        yield []
        return
    with Watchdog(stop, journal) as watchdog:
        yield [watchdog]
