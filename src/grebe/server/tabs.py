"""The pages that look on at a survey: what each of them has still to be told, and who steers."""

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

# A tab holds at most so many messages, and a page whose line broke is told what it missed where
# that is no more than the past holds: some two minutes at ten a second.
QUEUE = 40
PAST = 1200
# A tab that steers and is gone for so long steers no more [s].
GONE_S = 15.0


class Message(NamedTuple):
    """A message to all tabs, in the words of server-sent events."""

    kind: str
    text: bytes


NOTHING = Message("nothing", b"")


def message(kind: str, what: Any, number: str = "") -> Message:
    """A message, written out once for all who are told; by `number` a reader can go on from it."""
    known = f"id: {number}\n" if number else ""
    body = json.dumps(what, allow_nan=False)
    return Message(kind, f"{known}event: {kind}\ndata: {body}\n\n".encode())


class Past:
    """The last messages, for readers whose line broke."""

    def __init__(self) -> None:
        self._kept: deque[Message] = deque(maxlen=PAST)
        self._count = 0
        self._era = secrets.token_hex(4)

    @property
    def number(self) -> str:
        """The number of the last message."""
        return f"{self._era}.{self._count}"

    def add(self, kind: str, what: Any) -> Message:
        """Number a message and keep it."""
        self._count += 1
        told = message(kind, what, self.number)
        self._kept.append(told)
        return told

    def forget(self) -> None:
        """What was told does not lead to what is now: who comes back begins anew."""
        self._kept.clear()
        self._era = secrets.token_hex(4)

    def since(self, number: str) -> list[Message] | None:
        """The messages after a number; None where they are not all there."""
        era, _, text = number.partition(".")
        if era != self._era or not text.isdecimal():
            return None
        missed = self._count - int(text[:18])
        if not 0 <= missed <= len(self._kept):
            return None
        return list(self._kept)[len(self._kept) - missed :]


@dataclass(eq=False)
class Tab:
    """One page that looks on; `behind` where it has to be told all."""

    name: str
    queue: asyncio.Queue[Message] = field(default_factory=lambda: asyncio.Queue(QUEUE))
    behind: bool = False

    def tell(self, told: Message) -> None:
        """Tell it, or note that it fell behind."""
        if self.behind:
            return
        try:
            self.queue.put_nowait(told)
        except asyncio.QueueFull:
            self.behind = True

    def tell_all(self) -> None:
        """Tell it everything anew, soon."""
        self.behind = True
        with contextlib.suppress(asyncio.QueueFull):
            self.queue.put_nowait(NOTHING)

    def catch_up(self) -> None:
        """Drop what a snapshot is about to say."""
        while not self.queue.empty():
            self.queue.get_nowait()
        self.behind = False


@dataclass
class Lease:
    """Which tab steers, of all surveys: one, seen by all."""

    holder: str | None = None
    since: str | None = None

    def seen_by(self, tab: str) -> dict[str, Any]:
        """The lease in the words of a tab."""
        who = None if self.holder is None else "you" if self.holder == tab else "other"
        return {"holder": who, "since": self.since}

    def take(self, tab: str) -> None:
        """Give it to a tab."""
        self.holder, self.since = tab, iso(datetime.now(UTC))

    def expect(self, tab: str, is_back: Callable[[], bool]) -> None:
        """A tab is gone: if it is not back soon, it steers no more."""

        def look() -> None:
            if not is_back():
                self.leave(tab)

        with contextlib.suppress(RuntimeError):
            asyncio.get_running_loop().call_later(GONE_S, look)

    def leave(self, tab: str) -> None:
        """Take it from a tab that has it."""
        if self.holder == tab:
            self.holder = self.since = None
