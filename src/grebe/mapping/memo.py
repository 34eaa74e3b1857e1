"""Keep the last answers of a costly pure function of arrays.

Several ways to map the same readings ask for the same variogram. The readings come to them in
records of their own, so that what the arrays hold tells, not which arrays they are.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

P = ParamSpec("P")
R = TypeVar("R")


def remembered(most: int) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function to keep its `most` latest answers. Nobody may change an answer."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @lru_cache(maxsize=most)
        def answer(call: _Call) -> R:
            return function(*call.args, **call.kwargs)

        @wraps(function)
        def asked(*args: P.args, **kwargs: P.kwargs) -> R:
            return answer(_Call(args, kwargs))

        return asked

    return decorate


class _Call:
    """The arguments of a call; equal to another call's where their content is."""

    def __init__(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        self.args, self.kwargs = args, kwargs
        named = sorted(kwargs.items())
        self._content = (*map(_content, args), *((name, _content(one)) for name, one in named))

    def __hash__(self) -> int:
        return hash(self._content)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Call) and self._content == other._content


def _content(value: Hashable | np.ndarray) -> Hashable:
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    return value
