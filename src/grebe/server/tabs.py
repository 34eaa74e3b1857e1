"""The pages that watch a survey: the messages that each has yet to receive, and who steers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, NamedTuple

from grebe.server.mission_delta import iso

# Most messages that wait for one tab, and most past messages kept for pages that reconnect: two
# minutes at ten a second.
QUEUE = 40
PAST = 1200
# A steering tab that has been gone for this long loses the right to steer [s].
GONE_S = 15.0


class Message(NamedTuple):
    """A message to all tabs, encoded as a server-sent event."""

    kind: str
    text: bytes


NOTHING = Message("nothing", b"")


def encoded_message(kind: str, what: Any, number: str = "") -> Message:
    """A message, encoded once for all tabs; with `number` a reader can resume after it."""
    known = f"id: {number}\n" if number else ""
    body = json.dumps(what, allow_nan=False)
    return Message(kind, f"{known}event: {kind}\ndata: {body}\n\n".encode())


class Past:
    """The last messages, for readers that reconnect."""

    def __init__(self) -> None:
        self._kept: deque[Message] = deque(maxlen=PAST)
        self._count = 0
        self._era = secrets.token_hex(4)

    @property
    def number(self) -> str:
        """The number of the last message."""
        return f"{self._era}.{self._count}"

    def add(self, kind: str, what: Any) -> Message:
        """Make a message, number it and keep it."""
        self._count += 1
        message = encoded_message(kind, what, self.number)
        self._kept.append(message)
        return message

    def forget(self) -> None:
        """Drop all messages when they no longer lead to the present state, so that readers who come
        back get a snapshot.
        """
        self._kept.clear()
        self._era = secrets.token_hex(4)

    def since(self, number: str) -> list[Message] | None:
        """The messages after a number; None if not all of them are kept."""
        era, _, text = number.partition(".")
        if era != self._era or not text.isdecimal():
            return None
        missed = self._count - int(text[:18])
        if not 0 <= missed <= len(self._kept):
            return None
        return list(self._kept)[len(self._kept) - missed :]


@dataclass(eq=False)
class Tab:
    """One page that watches; `behind` if it needs a new snapshot."""

    name: str
    queue: asyncio.Queue[Message] = field(default_factory=lambda: asyncio.Queue(QUEUE))
    behind: bool = False

    def send(self, message: Message) -> None:
        """Queue a message, or note that the tab has fallen behind."""
        if self.behind:
            return
        try:
            self.queue.put_nowait(message)
        except asyncio.QueueFull:
            self.behind = True

    def send_snapshot(self) -> None:
        """Have the tab receive a new snapshot."""
        self.behind = True
        with contextlib.suppress(asyncio.QueueFull):
            self.queue.put_nowait(NOTHING)

    def catch_up(self) -> None:
        """Drop the waiting messages, because a snapshot replaces them."""
        while not self.queue.empty():
            self.queue.get_nowait()
        self.behind = False


@dataclass
class Lease:
    """The right to steer. At most one tab holds it, for all surveys, and every tab sees who."""

    holder: str | None = None
    since: str | None = None

    def seen_by(self, tab: str) -> dict[str, Any]:
        """The lease from a tab's point of view."""
        who = None if self.holder is None else "you" if self.holder == tab else "other"
        return {"holder": who, "since": self.since}

    def take(self, tab: str) -> None:
        """Give the lease to a tab."""
        self.holder, self.since = tab, iso(datetime.now(UTC))

    def expect(self, tab: str, is_back: Callable[[], bool]) -> None:
        """Take the lease from a tab that has gone, unless it is back within `GONE_S`."""

        def look() -> None:
            if not is_back():
                self.leave(tab)

        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop().call_later(GONE_S, look)

    def leave(self, tab: str) -> None:
        """Release the lease if the tab holds it."""
        if self.holder == tab:
            self.holder = self.since = None
