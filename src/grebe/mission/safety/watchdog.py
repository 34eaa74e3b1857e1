"""The watchdog: a separate process that stops the boat if the mission dies or hangs.

It is a second time-out for autopilots that have their own. The process starts before the boat gets
its first command, holds only what it needs to stop the boat, and belongs to no terminal. From the
first command on it receives a byte with each event of the mission, and a goodbye at the end.
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
from grebe.links import watchdog_process
from grebe.links.base import BoatLink
from grebe.links.emergency import EmergencyStop, emergency_of
from grebe.mission.events.recorders import Listener

# The time allowed for starting the process and importing its action [s].
START_S = 20.0
# The time allowed for stopping a boat that responds badly, and for ending [s].
END_S = 30.0


class Watchdog:
    """Guards a boat from its creation to the exit of its context. It is a listener, and takes each
    event as a sign of life.

    `journal` is the file in which the process notes what it had to do. Raises `LinkError` if the
    process does not start: a boat that nothing would stop must not set out.
    """

    def __init__(self, stop: EmergencyStop, journal: Path | None = None) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", watchdog_process.__file__],
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
        """Send the process its charge, and return its answer."""
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
        """The process id of the watchdog."""
        return self._process.pid

    @property
    def is_there(self) -> bool:
        """Whether the process is alive."""
        return self._process.poll() is None

    def __call__(self, event: MissionEvent) -> None:
        """Send a sign of life once the boat has had a command; this never waits and never fails."""
        self._under_orders = self._under_orders or isinstance(event, Step)
        if self._under_orders:
            self._write(b".")

    def _write(self, sign: bytes) -> None:
        # A full pipe means that the watchdog itself hangs, so waiting would be pointless.
        with suppress(OSError, ValueError):
            os.write(self._pipe.fileno(), sign)

    def dismiss(self) -> None:
        """Say goodbye, because the boat has been left without thrust in good order."""
        self._write(watchdog_process.GOODBYE)
        self._leave()

    def desert(self) -> None:
        """Leave without a goodbye, and wait until the watchdog has stopped the boat: nothing else
        may have stopped it.
        """
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
        # After these errors the mission has closed the link, which leaves the boat without thrust.
        in_order = isinstance(error, GrebeError | KeyboardInterrupt | None)
        if in_order and not isinstance(error, LinkError):
            self.dismiss()
        else:
            self.desert()


def journal_beside(path: Path) -> Path:
    """Return the path at which the watchdog of a survey file notes what it had to do."""
    return path.with_name(path.name + ".watchdog")


def taken_notes(journal: Path) -> list[str]:
    """Return the notes of a watchdog, in words, and delete its journal."""
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
    """Watch a link's boat while the mission runs; yields the listeners that this needs.

    A link without an emergency stop is not watched. Raises `LinkError` if the watchdog does not
    start; the caller closes the link.
    """
    stop = emergency_of(link)
    if stop is None:
        yield []
        return
    with Watchdog(stop, journal) as watchdog:
        yield [watchdog]
