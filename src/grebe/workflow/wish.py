"""The goal of extending a survey whose plan has been sailed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from grebe.core.errors import UsageError

Goal = Literal["accuracy", "threshold", "hot-spot"]
GOALS: tuple[Goal, ...] = ("accuracy", "threshold", "hot-spot")


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What a survey is extended for, and for how long.

    It is extended by `minutes`: for the accuracy of a quantity's map everywhere, for the line where
    the map crosses a `threshold`, or for the place where it is highest. It ends sooner once the
    map's standard deviation is no more than `sd`, in the quantity's unit.
    """

    quantity: str
    minutes: float
    goal: Goal = "accuracy"
    threshold: float | None = None
    sd: float | None = None

    def __post_init__(self) -> None:
        if self.goal not in GOALS:
            raise UsageError(f"There is no goal {self.goal!r}; choose {', '.join(GOALS)}.")
        if (self.goal == "threshold") != (self.threshold is not None):
            raise UsageError(
                "The goal 'threshold' needs a threshold, and no other goal takes one.",
                settings=("threshold", "goal"),
            )
        if not 0 < self.minutes < math.inf:
            raise UsageError(
                f"{self.minutes:g} minutes is impossible; give a positive number.",
                settings=("minutes",),
            )
        if self.sd is not None and not 0 < self.sd < math.inf:
            raise UsageError(
                f"A standard deviation of {self.sd:g} is impossible; give a positive number.",
                settings=("until_sd",),
            )

    @property
    def text(self) -> str:
        """The goal in words."""
        if self.goal == "threshold":
            return f"where {self.quantity} crosses {self.threshold:g}"
        if self.goal == "hot-spot":
            return f"where {self.quantity} is highest"
        return f"the accuracy of {self.quantity}"
