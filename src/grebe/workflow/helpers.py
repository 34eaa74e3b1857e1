"""Processes that help this one while it has several things to do.

They do not affect the results. A task is a pure function, and this process does any task that a
helper cannot do because it was killed, or because a user's own function cannot be sent to it.
"""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from grebe.workflow.worker_processes import begin_worker

A = TypeVar("A")
R = TypeVar("R")

# Each takes the memory of a process, and the last of many tasks has to be waited for anyway.
MOST_HELPERS = 3
# The same path as here, so that a user's own functions are found.
_HELP = (
    "import sys; sys.path[:] = {path}; "
    "from grebe.workflow.helpers import help_with; help_with({pipe}, {parent})"
)


class WorkerPool:
    """This process and its helpers, which end with the block."""

    def __init__(self, helpers: int = 0) -> None:
        self._count = helpers
        self._helpers: list[_Helper] = []

    def __enter__(self) -> WorkerPool:
        self._helpers = [_Helper.called() for _ in range(self._count)]
        return self

    def __exit__(self, *_: object) -> None:
        self._dismiss()

    def map(self, task: Callable[[A], R], items: Iterable[A]) -> Iterator[R]:
        """Yield the result of each item in the order of the items, as `map` does.

        Whoever is idle takes the next item. An error is raised at the item that it belongs to.
        """
        items = list(items)
        told = _pickled(task) if self._helpers and len(items) > 1 else None
        if told is None:
            yield from map(task, items)
            return
        work = _Work(items)
        feeding = [threading.Thread(target=one.feed, args=(told, work), daemon=True)
                   for one in self._helpers]  # fmt: skip
        for thread in feeding:
            thread.start()
        try:
            for number in range(len(items)):
                while not work.is_done(number):
                    mine = work.take()
                    if mine is None:
                        work.wait(number)
                    else:
                        work.put(mine, _done(task, items[mine]))
                yield _result(*work.result(number))
        except BaseException:
            work.give_up()
            self._dismiss()
            raise
        for thread in feeding:
            thread.join()

    def _dismiss(self) -> None:
        for one in self._helpers:
            one.dismiss()
        self._helpers = []


def idle_cores() -> int:
    """Return how many processors are available for helpers."""
    return min(len(os.sched_getaffinity(0)) - 1, MOST_HELPERS)


def _done(task: Callable[[A], R], item: A) -> tuple[R | None, Exception | None]:
    """Return the result or the error, which has to wait for the results of earlier items."""
    try:
        return task(item), None
    except Exception as error:
        return None, error


def _result(result: Any, error: Exception | None) -> Any:
    if error is not None:
        raise error
    return result


def _pickled(task: Callable[..., Any]) -> bytes | None:
    """Return a task pickled; None if it cannot be, such as a function within a function."""
    try:
        return pickle.dumps(task)
    except (pickle.PicklingError, AttributeError, TypeError):
        return None


@dataclass
class _Work:
    """The items to do and the results so far, by number; shared by several threads."""

    items: Sequence[Any]
    _waiting: list[int] = field(init=False)
    _results: dict[int, tuple[Any, Exception | None]] = field(
        default_factory=dict[int, tuple[Any, Exception | None]], init=False
    )
    _changed: threading.Condition = field(default_factory=threading.Condition, init=False)

    def __post_init__(self) -> None:
        self._waiting = list(range(len(self.items)))

    def take(self) -> int | None:
        """Take the next item, by its number; None if none is waiting."""
        with self._changed:
            return self._waiting.pop(0) if self._waiting else None

    def put(self, number: int, outcome: tuple[Any, Exception | None]) -> None:
        """Store the outcome of an item, a result or an error."""
        with self._changed:
            self._results[number] = outcome
            self._changed.notify_all()

    def put_back(self, number: int) -> None:
        """Give back an item that was taken, so that others can take it."""
        with self._changed:
            self._waiting.insert(0, number)
            self._changed.notify_all()

    def give_up(self) -> None:
        """Let no more items be taken."""
        with self._changed:
            self._waiting.clear()

    def is_done(self, number: int) -> bool:
        """Return whether an item has a result."""
        with self._changed:
            return number in self._results

    def wait(self, number: int) -> None:
        """Wait until an item is done, or another can be taken."""
        with self._changed:
            self._changed.wait_for(lambda: number in self._results or self._waiting)

    def result(self, number: int) -> tuple[Any, Exception | None]:
        """Return the outcome of an item, and forget it."""
        with self._changed:
            return self._results.pop(number)


@dataclass
class _Helper:
    """A process that receives tasks and sends back their outcomes."""

    process: subprocess.Popen[bytes]
    pipe: Connection

    @classmethod
    def called(cls) -> _Helper:
        ours, theirs = socket.socketpair()
        # In a session of its own it does not get Ctrl-C: its caller ends it.
        process = subprocess.Popen(
            [sys.executable, "-c",
             _HELP.format(path=sys.path, pipe=theirs.fileno(), parent=os.getpid())],
            pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        theirs.close()
        return cls(process=process, pipe=Connection(ours.detach()))

    def feed(self, told: bytes, work: _Work) -> None:
        """Hand on items until there are none left; one that comes back undone is left to others."""
        first: bytes | None = told
        while (number := work.take()) is not None:
            try:
                self.pipe.send_bytes(pickle.dumps((first, work.items[number])))
                is_done, result = self.pipe.recv()
            except Exception:
                is_done, result = False, None
            if not is_done:
                work.put_back(number)
                return
            first = None
            work.put(number, (result, None))

    def dismiss(self) -> None:
        self.process.kill()
        self.process.wait()
        self.pipe.close()


def help_with(pipe_number: int, parent: int) -> None:
    """Do a helper's work: take tasks from the pipe until it is closed."""
    begin_worker(parent)
    task: Any = None
    with Connection(pipe_number) as pipe, suppress(EOFError, OSError):
        while True:
            message = pipe.recv_bytes()
            try:
                told, item = pickle.loads(message)
                task = task if told is None else pickle.loads(told)
                answer = pickle.dumps((True, task(item)), pickle.HIGHEST_PROTOCOL)
            except Exception:
                answer = pickle.dumps((False, None))
            pipe.send_bytes(answer)
