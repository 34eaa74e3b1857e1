"""Find what separates the values of a table: a mark, or blanks.

A mark or a blank may also be within values: a decimal comma, a date and a time, a name of two
words. The separator is the one that occurs equally often in most lines.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence

# Blanks, as `separator` returns them; and the marks, of which the first wins a tie.
BLANKS = " "
_MARKS = "\t;,|"
# A number with a decimal comma between blanks, in which the comma separates nothing.
_DECIMALS = re.compile(r"(?<!\S)[+-]?\d+,\d+(?!\S)")
_QUOTED = re.compile(r'"[^"]*"')
# A line that is drawn below a header.
_DRAWN = re.compile(r"[-+|=:\s]+")
# Values between blanks: each is a word; or a date with its time is one value; or values are
# separated by two blanks or more, with single ones inside.
_WORD = re.compile(r'"[^"]*"|\S+')
_DATED = re.compile(r'"[^"]*"|\d+[-/.]\d+[-/.]\d+[ T]\d?\d:\d\d\S*(?: [AP]M\b)?|\S+', re.IGNORECASE)
_WIDE = re.compile(r'"[^"]*"|\S+(?: \S+)*')

_Values = Callable[[str], list[str]]


def separator(lines: Sequence[str]) -> str:
    """Return the mark that separates the values of some lines, or `BLANKS`.

    It is `BLANKS` if more lines agree on blanks than on any mark, and no mark is in more than half
    of them, other than within a number.
    """
    there = [_QUOTED.sub("", line) for line in lines if line.strip()]
    mark = max(_MARKS, key=lambda one: _agreement([line.count(one) for line in there]))
    bare = [_DECIMALS.sub("", line) for line in there]
    by_mark = max(_agreement([line.count(one) for line in bare])[0] for one in _MARKS)
    by_blanks = max(_agreement(_gaps(lines, values))[0] for values in _ways())
    held = max(sum(one in line for line in bare) for one in _MARKS)
    return BLANKS if by_blanks > by_mark and held <= len(there) / 2 else mark


def rows_of(text: str, separates: str, lines: Sequence[str]) -> list[list[str]]:
    """Return the rows of a text that are not empty; `lines` are its first ones.

    Raises `csv.Error`.
    """
    if separates == BLANKS:
        values = max(_ways(), key=lambda one: _agreement(_gaps(lines, one))[0])
        split = [values(line) for line in text.split("\n") if not _DRAWN.fullmatch(line)]
        return [row for row in split if row]
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separates) if any(row)]
    if separates != "|":
        return rows
    return [row for row in rows if not _DRAWN.fullmatch("|".join(row))]


def _agreement(counts: Sequence[int]) -> tuple[int, int]:
    """Return how many lines have the usual count, and that count."""
    usual = max(set(counts) - {0}, key=lambda each: (counts.count(each), each), default=0)
    return (counts.count(usual) if usual else 0, usual)


def _gaps(lines: Sequence[str], values: _Values) -> list[int]:
    found = [values(line) for line in lines if line.strip() and not _DRAWN.fullmatch(line)]
    return [len(row) - 1 for row in found]


def _ways() -> list[_Values]:
    """Return the ways to split a line at blanks; the first wins a tie."""
    return [_splitter(one) for one in (_WORD, _DATED, _WIDE)]


def _splitter(form: re.Pattern[str]) -> _Values:
    def values(line: str) -> list[str]:
        # A header may be a comment, as NumPy and MATLAB write it.
        bare = re.sub(r"^\s*[#%]+\s*", "", line)
        return [one.strip('"') for one in form.findall(bare)]

    return values
