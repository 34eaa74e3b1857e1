"""A line of a preflight list: what was checked, what was found, and what to do."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Verdict(enum.Enum):
    """The verdict of a line: go, look again, or stay ashore."""

    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "NOT"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One line; `advice` says what to do, and is empty if there is nothing to do."""

    what: str
    verdict: Verdict
    found: str
    advice: str = ""


def check(
    what: str,
    found: str,
    *,
    holds: bool,
    advice: str = "",
    otherwise: Verdict = Verdict.BAD,
) -> Check:
    """Return a line that is good if it `holds`, and otherwise has its advice."""
    verdict = Verdict.GOOD if holds else otherwise
    return Check(what=what, verdict=verdict, found=found, advice="" if holds else advice)
