"""Which readings of the sonde are kept: a setting of the mission, passed as a value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from grebe.core.errors import UsageError
from grebe.core.sets import TargetSet
from grebe.core.survey import Target


class Sampling(Protocol):
    """Decides whether a reading that is due is kept.

    `period_s` is the time between two readings.
    """

    @property
    def period_s(self) -> float:
        """Time between two readings [s]."""
        ...

    def keeps(self, surge_mps: float, ahead: TargetSet, within: Sequence[Target]) -> bool:
        """Return whether a reading at this surge [m/s] is kept.

        `ahead` is the current target set. `within` are the targets whose sets, in both footprint
        and speed window, contain the state.
        """
        ...


def _check(period_s: float) -> None:
    if not period_s > 0:
        raise UsageError(f"A sampling period of {period_s} s is not positive.")


@dataclass(frozen=True, kw_only=True)
class InWindow:
    """Every reading at a speed that suits the sensors: in the window of the set that contains it
    or, between sets, of the set for which the boat is heading. The default.
    """

    period_s: float = 1.0

    def __post_init__(self) -> None:
        _check(self.period_s)

    def keeps(self, surge_mps: float, ahead: TargetSet, within: Sequence[Target]) -> bool:
        """See `Sampling`."""
        return bool(within) or ahead.allows(surge_mps)


EVERY_SECOND = InWindow()


@dataclass(frozen=True, kw_only=True)
class InSets:
    """Only readings within a target set and its speed window, as in the paper (section 6.3)."""

    period_s: float = 1.0

    def __post_init__(self) -> None:
        _check(self.period_s)

    def keeps(self, surge_mps: float, ahead: TargetSet, within: Sequence[Target]) -> bool:  # noqa: ARG002
        """See `Sampling`."""
        return bool(within)
