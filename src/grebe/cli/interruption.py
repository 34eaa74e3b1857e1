"""Ctrl-C and SIGTERM end every command within a second, whatever it is doing.

Python handles a signal only between two of its own instructions, and a compiled kernel may run for
minutes. So a second thread receives the signal too. It gives the command time to end in good order,
and then ends the process. This harms no record: a survey file's journal is made for sudden death,
and of files being written only the unfinished parts are removed.

A boat does not wait for any of this. The second thread takes its thrust away as soon as the signal
arrives, even while a step is being solved or an estimate is awaited.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import Protocol

from grebe.cli import output
from grebe.core.errors import StoppedError
from grebe.io.atomic_write import forget_parts

# Time that a command has to end in good order [s].
GRACE_S = 0.8
INTERRUPTED = "interrupted; what was recorded is kept."
STOPPED = "stopped by the operator; what was recorded is kept."
ENDS = {signal.SIGINT: (INTERRUPTED, 130), signal.SIGTERM: (STOPPED, StoppedError.exit_code)}


class Stops(Protocol):
    """The part of a mission that signals act on."""

    def stop(self, why: str) -> None:
        """Take the thrust away at once."""
        ...

    def come_home(self, why: str) -> None:
        """Call the boat home."""
        ...


_MISSIONS: list[Stops] = []


def handle_signals_for(mission: Stops) -> None:
    """Make the signals that end the process stop this mission too, and SIGUSR1 call it home."""
    _MISSIONS.append(mission)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGUSR1, lambda *_: _call_home())


def _call_home() -> None:
    for mission in _MISSIONS:
        mission.come_home("called home by SIGUSR1")


def handle_signals() -> None:
    """Make SIGINT raise `KeyboardInterrupt` and SIGTERM `StoppedError`; both then end the process
    for certain.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, _stop)
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=_watch, args=(receiver, sender), daemon=True)
    watcher.start()


def ignore_hangup() -> None:
    """Continue if the terminal closes, for a boat is under way. Ctrl-C and SIGTERM still end it."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)


def _stop(signum: int, frame: FrameType | None) -> None:
    raise StoppedError(STOPPED)


def _watch(receiver: socket.socket, sender: socket.socket) -> None:
    """Wait for a signal that ends the process. Holding `sender` keeps that socket open."""
    number = 0
    while sender.fileno() >= 0 and number not in ENDS:
        number = receiver.recv(1)[0]
    sentence, code = ENDS[signal.Signals(number)]
    for mission in _MISSIONS:
        # A broken link must not keep the next boat from being stopped.
        with suppress(Exception):
            mission.stop(sentence)
    time.sleep(GRACE_S)
    forget_parts()
    output.fail(sentence)
    output.last_words()
    os._exit(code)
