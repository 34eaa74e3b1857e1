"""Output of the commands: results go to stdout, progress and notes to stderr."""

from __future__ import annotations

import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Self, TextIO, cast

import click

from grebe.cli.stalled_stream import LAST_WORDS_S, StalledStream

if TYPE_CHECKING:
    from grebe.mission.events.statistics import Progress as MissionProgress

TIP = "Next: "
# Longest time between two progress lines when stderr is no terminal [s].
LONGEST_SILENCE_S = 30.0


def make_streams_safe() -> None:
    """Reopen closed standard streams, and keep a blocked or broken stderr from ending the work.

    The next file opened would take the number of a closed stream, and the output would go into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    error = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    sys.stderr = cast("TextIO", StalledStream(error))


def give_up_stdout() -> None:
    """Discard output that stdout no longer accepts. Otherwise Python would try again at exit and
    print its own error message.
    """
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def last_words() -> None:
    """Write out pending messages before the process is killed."""
    if isinstance(sys.stderr, StalledStream):
        sys.stderr.drain(LAST_WORDS_S)


def note(text: str) -> None:
    """Print a message that is not part of the result."""
    click.echo(text, err=True)


def fail(text: str) -> None:
    """Print why the command ends."""
    click.echo(f"grebe: {text}", err=True)


def confirmation(*, yes: bool) -> Callable[[str], bool]:
    """Return the function that asks the operator before a real boat is armed. The operator has to
    type a word, since hitting a key would not be enough; `yes` skips the question.
    """

    def confirm(text: str) -> bool:
        note(text)
        return yes or click.prompt("Type ARM to go on", default="", show_default=False) == "ARM"

    return confirm


def compile_once() -> None:
    """Compile the controller unless it is compiled already, and say why it takes a while."""
    from grebe.core.kernels import is_compiled

    if not is_compiled():
        from grebe.workflow.kernel_cache import compile_controller

        note("compiling the controller, once: this takes half a minute or less")
        compile_controller()


def quoted(path: object) -> str:
    """A path quoted for a shell, for a command that the user may copy."""
    return shlex.quote(str(path))


def result(values: Mapping[str, Any], *, as_json: bool, next_command: str) -> None:
    """Print a result as a table or as one JSON object, and name the next command."""
    if as_json:
        click.echo(json.dumps(dict(values), ensure_ascii=False, default=str))
        return
    width = max(len(key) for key in values)
    for key, value in values.items():
        if value in ([], None):
            continue
        click.echo(f"  {key.replace('_', ' '):<{width}}  {_as_text(value)}")
    if next_command:
        click.echo(f"{TIP}{next_command}")


def _as_text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {one}" for key, one in value.items())
    return str(value)


class Pace:
    """Decides when a progress line is due, and extrapolates the time left."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = self._told = clock()
        self._done_before: float | None = None
        self._tenth = -1

    def is_due(self, done: float, total: float) -> bool:
        """Whether the work has entered another tenth since the last line, or that line is
        `LONGEST_SILENCE_S` old.
        """
        if self._done_before is None:
            self._done_before = done
        tenth = int(10 * done // max(total, 1))
        if tenth == self._tenth and self._clock() - self._told < LONGEST_SILENCE_S:
            return False
        self._tenth, self._told = tenth, self._clock()
        return True

    def left_s(self, done: float, total: float) -> float | None:
        """Wall time left [s]; None while the pace is unknown, and at the end."""
        fresh = done - (self._done_before or 0.0)
        if fresh <= 0 or done >= total:
            return None
        return (self._clock() - self._began) * (total - done) / fresh


def duration_text(seconds: float) -> str:
    """A duration in seconds, minutes or hours, whichever suits its length."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class _Bar:
    """A bar on a terminal, lines elsewhere, nothing if quiet."""

    def __init__(self, columns: str, what: str, total: float, *, quiet: bool) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        console = Console(file=sys.stderr)
        self._pace = Pace()
        self._lines = not quiet and not console.is_terminal
        self._bar = Progress(
            TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {what}"),
            BarColumn(),
            TextColumn(columns),
            TimeRemainingColumn(),
            console=console,
            disable=quiet or self._lines,
        )
        self._what = what
        self._task = self._bar.add_task(what, total=total, detail="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def _show(self, done: float, total: float, detail: str = "", more: str = "") -> None:
        self._bar.update(self._task, completed=done, total=total, detail=detail)
        if not self._lines or not self._pace.is_due(done, total):
            return
        parts = [f"{done:.0f}/{total:.0f} {self._what} ({100 * done / max(total, 1):.0f} %)"]
        parts += [detail] if detail else []
        left_s = self._pace.left_s(done, total)
        if left_s is not None:
            parts.append(f"about {duration_text(left_s)} left{more}")
        note(", ".join(parts))


class MissionBar(_Bar):
    """A progress bar for a mission: targets reached, boat time, and an estimate of the rest."""

    def __init__(self, *, quiet: bool) -> None:
        columns = "{task.percentage:>3.0f} %  {task.fields[detail]}  left:"
        super().__init__(columns, "sets", 1, quiet=quiet)
        self._before: MissionProgress | None = None

    def update(self, progress: MissionProgress) -> None:
        """Show the mission's progress."""
        self._before = self._before or progress
        boat_s = progress.boat_time_s - self._before.boat_time_s
        fresh = progress.reached - self._before.reached
        left = progress.targets - progress.reached
        more = f", {duration_text(boat_s * left / fresh)} of boat time" if fresh > 0 else ""
        detail = f"boat time {progress.boat_time_s:.0f} s, {progress.samples} samples"
        self._show(progress.reached, progress.targets, detail, more)


class Countdown(_Bar):
    """A progress bar for work in equal parts, with an estimate of the time left."""

    def __init__(self, what: str, total: int, *, quiet: bool) -> None:
        super().__init__("left:", what, total, quiet=quiet)

    def update(self, done: int, total: int) -> None:
        """Show that `done` of `total` parts are done."""
        self._show(done, total)
