"""A text stream that works even if nobody reads it.

A terminal may close, the disk of a log may be full, a reader at the end of a pipe may stop reading,
and Ctrl-S holds a terminal for as long as somebody is at lunch. None of that may stop a mission:
texts go to a separate thread, and only that thread waits for the reader.
"""

from __future__ import annotations

import atexit
import threading
from collections import deque
from typing import Any, TextIO

# How long a flush waits for the reader, so that lines of both streams stay in order [s]. A reader
# who kept it waiting gets no more time until everything is written.
TIMEOUT_S = 0.05
# Time at exit for the last texts, such as the reason why a command failed [s].
LAST_WORDS_S = 0.5
# Longest queue of unread texts; the oldest are dropped, which bounds the memory.
MOST_TEXTS = 1000


class StalledStream:
    """A stream that never blocks for long and never fails; it drops texts that it cannot write."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._waiting: deque[str] = deque(maxlen=MOST_TEXTS)
        self._changed = threading.Condition()
        self._writer: threading.Thread | None = None
        self._idle = True
        self._stalled = False
        self._failed = False
        atexit.register(self.drain, LAST_WORDS_S)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Hand a text to the writing thread.

        Anything but text raises `TypeError`, by which callers distinguish text from binary streams.
        """
        if not isinstance(text, str):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise TypeError(f"a text stream takes texts, not {type(text).__name__}")
        if text and not self._failed:
            with self._changed:
                self._waiting.append(text)
                self._idle = False
                self._changed.notify_all()
                if self._writer is None:
                    self._writer = threading.Thread(target=self._write_on, daemon=True)
                    self._writer.start()
        return len(text)

    def flush(self) -> None:
        """Wait up to `TIMEOUT_S` until all is written; do not wait if the last flush timed out."""
        if not self._stalled:
            self._stalled = not self.drain(TIMEOUT_S)

    def drain(self, timeout_s: float) -> bool:
        """Wait up to `timeout_s` until all is written, and return whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: self._idle, timeout_s)

    def _write_on(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: len(self._waiting) > 0)
                text = "".join(self._waiting)
                self._waiting.clear()
            self._attempt(text)
            with self._changed:
                self._idle = not self._waiting
                if self._idle:
                    self._stalled = False
                self._changed.notify_all()

    def _attempt(self, text: str) -> None:
        if self._failed:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._failed = True
