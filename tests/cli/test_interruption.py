"""The thread that receives signals stops the missions under way."""

import signal
import socket

import pytest

from grebe.cli import interruption


class Boat:
    def __init__(self, broken=False):
        self.broken, self.stopped = broken, False

    def stop(self, why):
        if self.broken:
            raise OSError("the line is cut")
        self.stopped = True


@pytest.fixture
def left(monkeypatch):
    """The exit codes with which a watcher would have ended the process; it has no grace period and
    prints nothing.
    """
    codes = []
    monkeypatch.setattr(interruption, "GRACE_S", 0.0)
    monkeypatch.setattr(interruption.os, "_exit", codes.append)
    monkeypatch.setattr(interruption.output, "fail", lambda _: None)
    monkeypatch.setattr(interruption.output, "last_words", lambda: None)
    return codes


def test_a_broken_line_keeps_no_other_boat_from_being_stopped(monkeypatch, left):
    boats = [Boat(broken=True), Boat()]
    monkeypatch.setattr(interruption, "_MISSIONS", boats)
    heard, told = socket.socketpair()
    with heard, told:
        told.send(bytes([signal.SIGTERM]))
        interruption._watch(heard, told)
    assert boats[1].stopped
    assert left == [interruption.ENDS[signal.SIGTERM][1]]


@pytest.mark.parametrize("number", [signal.SIGWINCH, signal.SIGUSR1])
def test_other_signals_end_nothing(monkeypatch, left, number):
    monkeypatch.setattr(interruption, "_MISSIONS", [Boat()])
    heard, told = socket.socketpair()
    with heard, told:
        told.send(bytes([number]))
        told.send(bytes([signal.SIGINT]))
        interruption._watch(heard, told)
    assert left == [interruption.ENDS[signal.SIGINT][1]]
