"""Spreads: the distributions from which the settings of each mission of a campaign are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from grebe.core.errors import UsageError

Value = float | str


class Spread(Protocol):
    """The distribution of a setting."""

    def draw(self, random: np.random.Generator) -> Value:
        """Return one random value."""
        ...

    def support(self) -> tuple[Value, ...]:
        """Return the lowest and the highest possible value, or all values of a list."""
        ...


@dataclass(frozen=True)
class OneOf:
    """One of several equally likely values; a single value is fixed."""

    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise UsageError(
                "A setting of a campaign has no values to choose from; give at least one."
            )

    def draw(self, random: np.random.Generator) -> Value:
        """See `Spread`."""
        return self.values[int(random.integers(len(self.values)))]

    def support(self) -> tuple[Value, ...]:
        """See `Spread`."""
        return self.values


@dataclass(frozen=True)
class Between:
    """Uniform from `low` to `high`."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not -math.inf < self.low <= self.high < math.inf:
            raise UsageError(
                f"There is nothing to draw from {self.low:g} to {self.high:g}; give the lower "
                "end first."
            )

    def draw(self, random: np.random.Generator) -> Value:
        """See `Spread`."""
        return float(random.uniform(self.low, self.high))

    def support(self) -> tuple[Value, ...]:
        """See `Spread`."""
        return self.low, self.high


@dataclass(frozen=True)
class Normal:
    """Normal with `mean` and `sd`, cut off at `low` and `high`: values beyond are drawn again."""

    mean: float
    sd: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        # Within these bounds a draw succeeds at least every sixth time, so redrawing ends.
        if not (self.sd > 0 and self.low <= self.mean <= self.high):
            raise UsageError(
                f"A normal spread with mean {self.mean:g} and standard deviation {self.sd:g} "
                "does not fit its bounds; give a positive deviation, and a mean within the "
                "bounds."
            )
        if self.high - self.low < self.sd:
            raise UsageError(
                "A normal spread has bounds less than one standard deviation apart; give [low, "
                "high] instead."
            )

    def draw(self, random: np.random.Generator) -> Value:
        """See `Spread`."""
        while not self.low <= (value := float(random.normal(self.mean, self.sd))) <= self.high:
            pass
        return value

    def support(self) -> tuple[Value, ...]:
        """See `Spread`."""
        return self.low, self.high


def spread_of(name: str, written: Any) -> Spread:
    """Return the spread that is written in a campaign's file.

    A number or a word is fixed, `[low, high]` is uniform, `{choose = [...]}` is one of a list, and
    `{mean = m, sd = s, low = l, high = h}` is normal. Raises `UsageError`, which names the setting.
    """
    try:
        return _spread(written)
    except UsageError as error:
        raise UsageError(f"{name}: {error}") from None
    except (KeyError, TypeError, ValueError):
        raise UsageError(
            f"{name} = {written!r} is not a spread; give a value, [low, high], {{choose = [...]}} "
            "or {mean = ..., sd = ...}."
        ) from None


def _spread(written: Any) -> Spread:
    if isinstance(written, Mapping):
        if set(written) == {"choose"}:
            return OneOf(tuple(map(_value, written["choose"])))
        if not {"mean", "sd"} <= set(written) <= {"mean", "sd", "low", "high"}:
            raise ValueError(written)
        return Normal(**{key: _number(value) for key, value in written.items()})
    if isinstance(written, Sequence) and not isinstance(written, str):
        low, high = written
        return Between(_number(low), _number(high))
    return OneOf((_value(written),))


def _value(written: Any) -> Value:
    return written if isinstance(written, str) else _number(written)


def _number(written: Any) -> float:
    if isinstance(written, bool) or not isinstance(written, int | float):
        raise TypeError(written)
    if not math.isfinite(written):
        raise ValueError(written)
    return float(written)
