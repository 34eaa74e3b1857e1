"""Quantities read from tables of TOML or JSON: one format for built-in and user quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from math import isfinite
from typing import Any, cast

from grebe.core.errors import InputError
from grebe.core.quantity import (
    LakeStatistics,
    Limits,
    Quantities,
    Quantity,
    Span,
    check_span,
    usual_limits,
)


def quantities_of(
    tables: Mapping[str, object], base: Mapping[str, Quantity], source: str
) -> Quantities:
    """Read quantities from tables by key, as TOML or JSON gives them.

    A table whose key is in `base` changes only the fields that it gives; any other must be
    complete. Raises `InputError` with the `source` and the error in it.
    """
    entries: list[Quantity] = []
    for key, table in tables.items():
        if not isinstance(table, Mapping):
            raise InputError(
                f"{source}: {key} is not a table; write [{key}] and its entries below."
            )
        try:
            entries.append(_entry(key, cast("Mapping[str, Any]", table), base.get(key)))
        except InputError as error:
            raise InputError(f"{source}: [{key}] {error}") from None
    return Quantities(entries)


def _entry(key: str, table: Mapping[str, Any], before: Quantity | None) -> Quantity:
    unknown = sorted(set(table) - set(_READERS))
    if unknown:
        raise InputError(f"holds {unknown[0]!r}; it may hold {', '.join(sorted(_READERS))}.")
    lacking = [name for name in _REQUIRED if name not in table]
    if before is None and lacking:
        raise InputError(f"is new and lacks {', '.join(lacking)}.")
    given = {name: _READERS[name](name, value) for name, value in table.items()}
    if "label" in given:
        given["labels"] = given.pop("label")
    span = given.get("span", before.span if before else None)
    mapped = given.get("mapped", True)
    usual = before.limits if before else usual_limits(span, mapped=mapped)
    if before and "span" in given:
        usual = replace(usual, fail_span=span)
    given["limits"] = replace(usual, **given.get("limits", {}))
    if before is not None:
        return replace(before, **given)
    return Quantity(key=key, **given)


def _read_label(name: str, value: object) -> dict[str, str]:
    texts = cast("Mapping[str, Any]", value) if isinstance(value, Mapping) else {"en": value}
    if not all(isinstance(text, str) and text for text in texts.values()):
        raise InputError(f"{name} must be a text, or a table such as {{ en = '...', fr = '...' }}.")
    return {language: str(text) for language, text in texts.items()}


def _read_truth(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{name} must be true or false, not {value!r}.")
    return value


def _read_list(read: Callable[[str, object], Any]) -> Callable[[str, object], tuple[Any, ...]]:
    def all_of(name: str, value: object) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple):
            raise InputError(f"{name} must be a list, not {value!r}.")
        return tuple(read(name, one) for one in cast("list[Any]", value))

    return all_of


def _read_lake(name: str, value: object) -> LakeStatistics:
    known = sorted(one.name for one in fields(LakeStatistics))
    if not isinstance(value, Mapping) or set(cast("Mapping[str, Any]", value)) != set(known):
        raise InputError(f"{name} must be a table of {', '.join(known)}.")
    given = cast("Mapping[str, Any]", value)
    return LakeStatistics(**{key: _read_number(key, one) for key, one in given.items()})


def read_limit_table(value: object, name: str = "limits") -> dict[str, float | Span]:
    """The fields of `Limits` that a table gives; raises `InputError` if it is invalid."""
    known = {one.name for one in fields(Limits)}
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a table, not {value!r}.")
    table = cast("Mapping[str, Any]", value)
    unknown = sorted(set(table) - known)
    if unknown:
        raise InputError(f"holds {unknown[0]!r}; it may hold {', '.join(sorted(known))}.")
    return {
        limit: (read_span if limit.endswith("_span") else _read_number)(limit, one)
        for limit, one in table.items()
    }


def _read_number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, which is not a number.")
    if not isfinite(value):
        raise InputError(f"{name} is {value}; give a finite number.")
    return float(value)


def _read_text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name} is {value!r}, which is not text.")
    return value


def read_span(name: str, value: object) -> Span:
    """Read a span, two ascending numbers; raises `InputError` if it is invalid."""
    pair = cast("list[Any]", value) if isinstance(value, list | tuple) else []
    if len(pair) != 2:
        raise InputError(f"{name} is {value!r}; give two numbers, [low, high].")
    span = _read_number(name, pair[0]), _read_number(name, pair[1])
    check_span(name, span)
    return span


_READERS: dict[str, Callable[[str, object], Any]] = {
    "label": _read_label,
    "unit": _read_text,
    "cf_unit": _read_text,
    "standard_name": _read_text,
    "span": read_span,
    "resolution": _read_number,
    "columns": _read_list(_read_text),
    "missing": _read_list(_read_number),
    "limits": lambda name, value: read_limit_table(value, name),
    "lake": _read_lake,
    "air_share": _read_number,
    "on_sonde": _read_truth,
    "mapped": _read_truth,
    "colormap": _read_text,
}
_REQUIRED = ("label", "unit", "cf_unit", "span", "resolution")
