"""What every command prints: results on stdout, progress and notes on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from grebe.mission.statistics import Progress as MissionProgress

TIP = "Next: "


def note(text: str) -> None:
    """Tell the user something that is not the result."""
    click.echo(text, err=True)


def fail(text: str) -> None:
    """Tell the user why the command ends."""
    click.echo(f"grebe: {text}", err=True)


def note_compilation() -> None:
    """Say why the first run is slow to start, where it will be."""
    from grebe.core.kernels import is_compiled

    if not is_compiled():
        note("compiling the controller, once: about half a minute")


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


class MissionBar:
    """A progress bar for a mission: targets reached, coverage, and an estimate of the rest."""

    def __init__(self, *, quiet: bool) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        console = Console(file=sys.stderr)
        # A log file wants lines, not a bar: one for each tenth.
        self._lines = not quiet and not console.is_terminal
        self._told = -1
        self._bar = Progress(
            TextColumn("{task.completed:.0f}/{task.total:.0f} sets"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %  {task.fields[detail]}  left:"),
            TimeRemainingColumn(),
            console=console,
            disable=quiet or self._lines,
        )
        self._task = self._bar.add_task("mission", total=1, detail="")

    def __enter__(self) -> MissionBar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def update(self, progress: MissionProgress) -> None:
        """Show how far the mission is."""
        detail = f"boat time {progress.boat_time_s:.0f} s, {progress.samples} samples"
        self._bar.update(
            self._task, completed=progress.reached, total=progress.targets, detail=detail
        )
        tenth = 10 * progress.reached // max(progress.targets, 1)
        if self._lines and tenth != self._told:
            self._told = tenth
            left = _remaining_text(progress)
            note(f"{progress.reached}/{progress.targets} sets ({10 * tenth} %), {detail}{left}")


def _remaining_text(progress: MissionProgress) -> str:
    if progress.reached in {0, progress.targets}:
        return ""
    pace = progress.boat_time_s / progress.reached
    return f", about {pace * (progress.targets - progress.reached):.0f} s of boat time left"


class Countdown:
    """A progress bar for work in equal parts, with an estimate of what is left."""

    def __init__(self, what: str, total: int, *, quiet: bool) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        console = Console(file=sys.stderr)
        self._what, self._began = what, time.monotonic()
        # A log file wants lines, not a bar.
        self._lines = not quiet and not console.is_terminal
        self._bar = Progress(
            TextColumn(f"{{task.completed}}/{{task.total}} {what}"),
            BarColumn(),
            TextColumn("left:"),
            TimeRemainingColumn(),
            console=console,
            disable=quiet or self._lines,
        )
        self._task = self._bar.add_task(what, total=total)

    def __enter__(self) -> Countdown:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def update(self, done: int, total: int) -> None:
        """Show how many parts are done."""
        self._bar.update(self._task, completed=done, total=total)
        if self._lines:
            left = (time.monotonic() - self._began) * (total - done) / max(done, 1)
            note(f"{done}/{total} {self._what}, about {left:.0f} s left")
