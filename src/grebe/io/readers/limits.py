"""Read limits for quality control from TOML: one table a quantity, what is not said stays.

[ph]
suspect_span = [6.0, 9.5]
spike_suspect = 0.2
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TypeGuard

from grebe.core.errors import InputError
from grebe.io.readers.text import read_text
from grebe.mapping.quality import DEFAULT_LIMITS, Limits


def read_limits(path: Path) -> dict[str, Limits]:
    """Return the limits of every quantity; `InputError` says what is wrong with the file."""
    try:
        tables = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not TOML: {error}.") from None
    limits = dict(DEFAULT_LIMITS)
    known = {one.name for one in fields(Limits)}
    for key, given in tables.items():
        if key not in limits:
            raise InputError(f"{path}: no quantity {key!r}; one of {', '.join(limits)}.")
        if not isinstance(given, dict):
            raise InputError(f"{path}: {key} is no table; write [{key}] and its limits below.")
        unknown = sorted(set(given) - known)
        if unknown:
            raise InputError(
                f"{path}: [{key}] holds {unknown[0]!r}; it may hold {', '.join(sorted(known))}."
            )
        limits[key] = _limits(path, key, limits[key], given)
    return limits


def _limits(path: Path, key: str, before: Limits, given: Mapping[str, object]) -> Limits:
    """Limits of a quantity with what a table says put in; each must be of its own kind."""
    values = {
        name: _number(f"{path}: {name} of {key}", value, span=_is_span(getattr(before, name)))
        for name, value in given.items()
    }
    return replace(before, **values)


def _is_span(value: object) -> bool:
    return isinstance(value, tuple)


def _number(what: str, value: object, *, span: bool) -> float | tuple[float, float]:
    """A finite number, or a span of two ascending ones."""
    if not span and _is_finite(value):
        return float(value)
    if span and isinstance(value, list) and len(value) == 2 and all(map(_is_finite, value)):
        low, high = float(value[0]), float(value[1])
        if low < high:
            return low, high
        raise InputError(f"{what} goes from {low:g} to {high:g}; give the lower number first.")
    wanted = "a span of two finite numbers, [low, high]" if span else "a finite number"
    raise InputError(f"{what} is {value!r}; give {wanted}.")


def _is_finite(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
