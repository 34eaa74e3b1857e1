"""What a reproduced figure is held to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Check:
    """Something that a figure must show, the number that was found, and whether it does."""

    what: str
    found: str
    holds: bool


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """A figure that has been drawn, and its checks."""

    figure: str
    picture: Path
    checks: tuple[Check, ...]

    @property
    def holds(self) -> bool:
        """Whether the figure shows all that it must."""
        return all(check.holds for check in self.checks)
