"""A line of a preflight list: what was looked at, what was found, and what to do."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Verdict(enum.Enum):
    """What a line of the list says: go, think again, or stay ashore."""

    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "NOT"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One line: `advice` says what to do, and is empty where nothing is."""

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
    """Return a line that is good where it holds; its advice stands only where it does not."""
    verdict = Verdict.GOOD if holds else otherwise
    return Check(what=what, verdict=verdict, found=found, advice="" if holds else advice)
