"""The checks of a reproduced figure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Check:
    """A property that a figure must show, what was found, and whether it holds."""

    what: str
    found: str
    holds: bool


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """A figure that was drawn, and its checks."""

    figure: str
    picture: Path
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether all checks hold."""
        return all(check.holds for check in self.checks)
