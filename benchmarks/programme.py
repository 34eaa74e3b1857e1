"""A table of rows, each measured by its own function; if one fails, the others go on."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.common import print_head, print_row


@dataclass(frozen=True, kw_only=True)
class Row:
    """What is measured, by which function, the goals (at least, and at best), and about how many
    minutes it takes, including what it computes for later rows.
    """

    what: str
    measure: Callable[[], str]
    at_least: str = ""
    aim: str = ""
    minutes: float = 0.1


def run(title: str, rows: Sequence[Row]) -> None:
    """Measure all rows, then print them as one table.

    Raises `SystemExit` if some could not be measured.
    """
    began = time.monotonic()
    measured, failures = measure_all(rows)
    minutes = (time.monotonic() - began) / 60
    print_head(title, "what", "measured", "at least", "aim")
    for row, told in zip(rows, measured, strict=True):
        print_row(row.what, told, row.at_least, row.aim)
    print(f"\nMeasured in {minutes:.0f} minutes.")
    if failures:
        raise SystemExit(f"{failures} of {len(rows)} rows could not be measured.")


def measure_all(rows: Sequence[Row]) -> tuple[list[str], int]:
    """Measure row by row; return each row's result or why it failed, and how many failed.

    Progress goes to the standard error, with the remaining time at the pace so far: the table
    alone is the output.
    """
    measured: list[str] = []
    failures, done = 0, 0.0
    began, whole = time.monotonic(), sum(row.minutes for row in rows)
    for number, row in enumerate(rows, 1):
        pace = (time.monotonic() - began) / 60 / done if done else 1.0
        left = pace * (whole - done)
        _say(f"[{number} of {len(rows)}, some {left:.0f} minutes left] {row.what}")
        try:
            told = row.measure()
        except Exception as error:  # whatever it is, the other rows are worth having
            told = f"failed: {type(error).__name__}: {error}".splitlines()[0].replace("|", "/")
            failures += 1
        _say(f"    {told}")
        measured.append(told)
        done += row.minutes
    return measured, failures


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
