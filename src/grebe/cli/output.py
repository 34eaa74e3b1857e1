"""What every command prints: results on stdout, progress and notes on stderr."""

from __future__ import annotations

import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Self, TextIO, cast

import click

from grebe.cli.unwatched import LAST_WORDS_S, Unwatched

if TYPE_CHECKING:
    from grebe.mission.telling.statistics import Progress as MissionProgress

TIP = "Next: "
# Where there is no terminal for a bar, the longest time between two lines [s].
LONGEST_SILENCE_S = 30.0


def make_streams_safe() -> None:
    """Open what is closed of the standard streams, and let nobody who watches end the work.

    A closed one would be the next file opened, and what is printed would go into that file.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    error = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    sys.stderr = cast("TextIO", Unwatched(error))


def give_up_stdout() -> None:
    """Drop what cannot be written to standard output any more: Python would try once more when it
    ends, and complain in its own words.
    """
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def last_words() -> None:
    """Let what was said come out before the process is ended by force."""
    if isinstance(sys.stderr, Unwatched):
        sys.stderr.drain(LAST_WORDS_S)


def note(text: str) -> None:
    """Tell the user something that is not the result."""
    click.echo(text, err=True)


def fail(text: str) -> None:
    """Tell the user why the command ends."""
    click.echo(f"grebe: {text}", err=True)


def confirmation(*, yes: bool) -> Callable[[str], bool]:
    """How the operator is asked before a real boat is armed: a word is typed, not a key hit."""

    def confirm(text: str) -> bool:
        note(text)
        return yes or click.prompt("Type ARM to go on", default="", show_default=False) == "ARM"

    return confirm


def compile_once() -> None:
    """Compile the controller where that is still to be done, and say why it takes a while."""
    from grebe.core.kernels import is_compiled

    if not is_compiled():
        from grebe.workflow.kernel_cache import compile_controller

        note("compiling the controller, once: about a minute")
        compile_controller()


def quoted(path: object) -> str:
    """A path as a shell reads it, of a command that is to be copied."""
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
        text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else value
        click.echo(f"  {key.replace('_', ' '):<{width}}  {text}")
    if next_command:
        click.echo(f"{TIP}{next_command}")


class Pace:
    """When a line of progress is due, and how long the rest takes at the pace so far."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = self._told = clock()
        self._done_before: float | None = None
        self._tenth = -1

    def is_due(self, done: float, total: float) -> bool:
        """Whether a tenth of the work is done since the last line, or much time has passed."""
        if self._done_before is None:
            self._done_before = done
        tenth = int(10 * done // max(total, 1))
        if tenth == self._tenth and self._clock() - self._told < LONGEST_SILENCE_S:
            return False
        self._tenth, self._told = tenth, self._clock()
        return True

    def left_s(self, done: float, total: float) -> float | None:
        """Wall time that is left [s]; None while nothing is known of the pace."""
        fresh = done - (self._done_before or 0.0)
        if fresh <= 0 or done >= total:
            return None
        return (self._clock() - self._began) * (total - done) / fresh


def duration_text(seconds: float) -> str:
    """A time as a person says it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class _Bar:
    """A bar on a terminal, lines in a log, nothing where it is to be quiet."""

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
        """Show how far the mission is."""
        self._before = self._before or progress
        boat_s = progress.boat_time_s - self._before.boat_time_s
        fresh = progress.reached - self._before.reached
        left = progress.targets - progress.reached
        more = f", {duration_text(boat_s * left / fresh)} of boat time" if fresh > 0 else ""
        detail = f"boat time {progress.boat_time_s:.0f} s, {progress.samples} samples"
        self._show(progress.reached, progress.targets, detail, more)


class Countdown(_Bar):
    """A progress bar for work in equal parts, with an estimate of what is left."""

    def __init__(self, what: str, total: int, *, quiet: bool) -> None:
        super().__init__("left:", what, total, quiet=quiet)

    def update(self, done: int, total: int) -> None:
        """Show how many parts are done."""
        self._show(done, total)
