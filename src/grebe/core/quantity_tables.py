"""Quantities from tables, as TOML or JSON gives them: one format for ours and a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from math import isfinite
from typing import Any, cast

from grebe.core.errors import InputError
from grebe.core.quantity import LakeStatistics, Limits, Quantities, Quantity, Span, check_span


def quantities_of(
    tables: Mapping[str, object], base: Mapping[str, Quantity], source: str
) -> Quantities:
    """Read entries from tables by key, as TOML or JSON gives them.

    A table of a key that `base` has changes what it says and leaves the rest; any other must be
    complete. `InputError` names the `source` and what is wrong with it.
    """
    entries: list[Quantity] = []
    for key, table in tables.items():
        if not isinstance(table, Mapping):
            raise InputError(f"{source}: {key} is no table; write [{key}] and its entries below.")
        try:
            entries.append(_entry(key, cast("Mapping[str, Any]", table), base.get(key)))
        except InputError as error:
            raise InputError(f"{source}: [{key}] {error}") from None
    return Quantities(entries)


_NAMES = {one.name for one in fields(Quantity)} - {"key", "labels"} | {"label"}
_REQUIRED = sorted(
    {one.name for one in fields(Quantity) if one.default is MISSING} - {"key", "labels", "limits"}
    | {"label"}
)


def _entry(key: str, table: Mapping[str, Any], before: Quantity | None) -> Quantity:
    unknown = sorted(set(table) - _NAMES)
    if unknown:
        raise InputError(f"holds {unknown[0]!r}; it may hold {', '.join(sorted(_NAMES))}.")
    lacking = [name for name in _REQUIRED if name not in table]
    if before is None and lacking:
        raise InputError(f"is new and lacks {', '.join(lacking)}.")
    given = {name: _read(name, value) for name, value in table.items()}
    if "label" in given:
        given["labels"] = given.pop("label")
    span = given.get("span", before.span if before else None)
    usual = before.limits if before else Limits(fail_span=span, suspect_span=span)
    if before and "span" in given:
        usual = replace(usual, fail_span=span)
    given["limits"] = replace(usual, **given.get("limits", {}))
    if before is not None:
        return replace(before, **given)
    return Quantity(key=key, **given)


def _read(name: str, value: Any) -> Any:  # noqa: PLR0911 - one return for each kind of entry
    """One entry of a table as the record has it."""
    if name == "label":
        texts = value if isinstance(value, Mapping) else {"en": value}
        if not all(isinstance(text, str) and text for text in texts.values()):
            raise InputError("label is a text, or a table such as { en = '...', fr = '...' }.")
        return dict(cast("Mapping[str, str]", texts))
    if name in {"unit", "cf_unit", "standard_name", "colormap"}:
        return _text(name, value)
    if name in {"on_sonde", "mapped"}:
        if not isinstance(value, bool):
            raise InputError(f"{name} is true or false, not {value!r}.")
        return value
    if name == "span":
        return read_span(name, value)
    if name in {"columns", "missing"}:
        if not isinstance(value, list | tuple):
            raise InputError(f"{name} is a list, not {value!r}.")
        read = _text if name == "columns" else _number
        return tuple(read(name, one) for one in cast("list[Any]", value))
    if name == "limits":
        return read_limit_table(value)
    if name == "lake":
        return None if value is None else LakeStatistics(**_numbers("lake", value, LakeStatistics))
    return None if value is None else _number(name, value)


def read_limit_table(value: object) -> dict[str, float | Span]:
    """The fields of `Limits` that a table gives; `InputError` says what is wrong with it."""
    known = {one.name for one in fields(Limits)}
    if not isinstance(value, Mapping):
        raise InputError(f"limits is a table, not {value!r}.")
    table = cast("Mapping[str, Any]", value)
    unknown = sorted(set(table) - known)
    if unknown:
        raise InputError(f"holds {unknown[0]!r}; it may hold {', '.join(sorted(known))}.")
    return {
        name: read_span(name, one) if name.endswith("_span") else _number(name, one)
        for name, one in table.items()
    }


def _numbers(name: str, value: object, record: type) -> dict[str, float]:
    known = sorted(one.name for one in fields(record))
    if not isinstance(value, Mapping) or set(cast("Mapping[str, Any]", value)) != set(known):
        raise InputError(f"{name} is a table of {', '.join(known)}.")
    return {key: _number(key, one) for key, one in cast("Mapping[str, Any]", value).items()}


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, which is no number.")
    if not isfinite(value):
        raise InputError(f"{name} is {value}; give a finite number.")
    return float(value)


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name} is {value!r}, which is no text.")
    return value


def read_span(name: str, value: object) -> Span:
    """Two ascending numbers."""
    pair = cast("list[Any]", value) if isinstance(value, list | tuple) else []
    if len(pair) != 2:
        raise InputError(f"{name} is {value!r}; give two numbers, [low, high].")
    span = _number(name, pair[0]), _number(name, pair[1])
    check_span(name, span)
    return span
