"""Read limits for quality control from TOML: one table a quantity, what is not said stays.

[ph]
suspect_span = [6.0, 9.5]
spike_suspect = 0.2
"""

from __future__ import annotations

import tomllib
from dataclasses import fields, replace
from pathlib import Path

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
        limits[key] = replace(limits[key], **{name: _number(path, v) for name, v in given.items()})
    return limits


def _number(path: Path, value: object) -> float | tuple[float, float]:
    """A number, or a span of two ascending ones."""
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, list) and len(value) == 2 and value[0] < value[1]:
        return float(value[0]), float(value[1])
    raise InputError(f"{path}: {value!r} is neither a number nor a span [low, high].")
