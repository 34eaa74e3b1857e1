"""The record of a quantity of the water, and a registry of such records.

A `Quantity` says what it is called, measured in, and held to; `Quantities` is an immutable
registry of them in their order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from math import isfinite
from types import MappingProxyType
from typing import Any

from grebe.core.errors import InputError

# A key names a column of SQLite, a variable of NetCDF and files.
_KEY = re.compile(r"[a-z][a-z0-9_]{0,59}")
# What the survey file's samples have besides quantities, or would clash with a flag's column.
_RESERVED = frozenset({"fid", "geom", "time", "lat", "lon", "target_seq", "speed_mps"})
Span = tuple[float, float]


def inline(label: str) -> str:
    """A name as it stands within a sentence: lower case, unless its first word has a spelling of
    its own, such as pH or ORP.
    """
    first = label.split(" ", 1)[0]
    return label[:1].lower() + label[1:] if first[1:].islower() else label


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What is possible and what is usual for one quantity, in its unit.

    `fail_span`, `suspect_span`: gross range. `spike_suspect`, `spike_fail`: a value off both
    neighbours to the same side. `rate_per_s`: steepest change. `flat_suspect_s`, `flat_fail_s`:
    how long a value may stay within `flat_tolerance`. What is infinite is not tested.
    """

    fail_span: Span
    suspect_span: Span
    spike_suspect: float = float("inf")
    spike_fail: float = float("inf")
    rate_per_s: float = float("inf")
    flat_tolerance: float = 1e-9
    flat_suspect_s: float = 300.0
    flat_fail_s: float = 900.0

    def __post_init__(self) -> None:
        for name in ("fail_span", "suspect_span"):
            check_span(name, getattr(self, name))
        rest = (one.name for one in fields(self) if not one.name.endswith("_span"))
        for name in rest:
            if not getattr(self, name) >= 0:
                raise InputError(f"{name} is {getattr(self, name)!r}; give 0 or more.")


def usual_limits(span: Span, *, mapped: bool) -> Limits:
    """The limits of a quantity of which no more is said than its span. How the sonde was, which is
    not mapped, may stand still for as long as it likes: its depth, the voltage of its battery.
    """
    if mapped:
        return Limits(fail_span=span, suspect_span=span)
    still = float("inf")
    return Limits(fail_span=span, suspect_span=span, flat_suspect_s=still, flat_fail_s=still)


@dataclass(frozen=True, kw_only=True)
class LakeStatistics:
    """How a quantity varies within a lake: mean, standard deviation, range of the variogram
    over the lake's extent, and share of the variance that is correlated.
    """

    mean: float
    sd: float
    range_share: float
    structured_share: float

    def __post_init__(self) -> None:
        if not isfinite(self.mean):
            raise InputError(f"the lake's mean is {self.mean!r}; give a number.")
        if not (0 < self.sd < float("inf") and 0 < self.range_share < float("inf")):
            raise InputError("the lake's sd and range_share are positive numbers.")
        if not 0 < self.structured_share <= 1:
            raise InputError(f"structured_share is {self.structured_share!r}; give 0 to 1.")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One measured quantity.

    `key` is its column in the survey file and its variable in NetCDF; `labels` its name by
    language, English at least; `unit` the unit of the column, `cf_unit` the same in UDUNITS;
    `standard_name` that of the CF table, empty where none is right. `span` is the gross range in
    which a value on a lake is possible at all (QARTOD's gross range test fails outside it);
    `resolution` the step in which common sondes report it, below which nothing is known.

    `columns` are regular expressions that a track's column may match, the first match wins: in
    lower-case letters, digits and the signs ° µ alone, or `before/this` with the name of the
    column before it. `missing` are numbers that stand for no value there. `limits` are those of
    quality control. `lake` is what a simulated lake has of it, None for nothing.

    `air_share`: in the air the sensor reads less than this share of the record's median, None
    where that tells nothing. `on_sonde`: it settles, and comes out of the water, with the sonde.
    `mapped`: a property of the water, to be mapped; what is not may stand still. `colormap` is
    matplotlib's.
    """

    key: str
    labels: Mapping[str, str]
    unit: str
    cf_unit: str
    span: Span
    resolution: float
    limits: Limits
    standard_name: str = ""
    columns: tuple[str, ...] = ()
    missing: tuple[float, ...] = ()
    lake: LakeStatistics | None = None
    air_share: float | None = None
    on_sonde: bool = True
    mapped: bool = True
    colormap: str = "cividis"

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key) or self.key in _RESERVED or self.key.endswith("_qc"):
            raise InputError(
                f"{self.key!r} cannot be a quantity's key: give lower-case letters, digits and _, "
                f"not ending in _qc, and none of {', '.join(sorted(_RESERVED))}."
            )
        object.__setattr__(self, "labels", MappingProxyType(dict(self.labels)))
        if not self.labels.get("en"):
            raise InputError("label holds no English text; write label = { en = '...' }.")
        check_span("span", self.span)
        if not 0 <= self.resolution < float("inf"):
            raise InputError(f"resolution is {self.resolution!r}; give 0 or more.")
        if self.air_share is not None and not 0 < self.air_share < 1:
            raise InputError(f"air_share is {self.air_share!r}; give a share between 0 and 1.")
        for pattern in self.columns:
            try:
                re.compile(pattern)
            except re.error as error:
                raise InputError(
                    f"columns: {pattern!r} is not a regular expression: {error}."
                ) from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy with the labels as a plain table: a read-only mapping cannot be."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return _of_values, (values | {"labels": dict(self.labels)},)

    @property
    def label(self) -> str:
        """The English name."""
        return self.labels["en"]

    @property
    def inline(self) -> str:
        """The English name as it stands within a sentence: `temperature`, but `pH`."""
        return inline(self.label)

    def label_in(self, language: str) -> str:
        """The name in a language, in English where it has none."""
        return self.labels.get(language, self.label)

    def as_table(self) -> dict[str, Any]:
        """The entry as a table of TOML or JSON, which `quantities_of` reads back."""
        table: dict[str, Any] = {"label": dict(self.labels)}
        for one in fields(self):
            value = getattr(self, one.name)
            if one.name in {"key", "labels"} or value == one.default:
                continue
            if isinstance(value, LakeStatistics):
                value = {part.name: getattr(value, part.name) for part in fields(value)}
            elif isinstance(value, Limits):
                # What is usual is left out, and so what is infinite: JSON has no word for it.
                usual = usual_limits(self.span, mapped=self.mapped)
                value = {
                    part.name: _plain(getattr(value, part.name))
                    for part in fields(value)
                    if part.name.endswith("_span")
                    or getattr(value, part.name) != getattr(usual, part.name)
                }
            table[one.name] = _plain(value)
        return table


class Quantities(Mapping[str, Quantity]):
    """An immutable registry: quantities by key, in their order."""

    def __init__(self, entries: Iterable[Quantity] = ()) -> None:
        table: dict[str, Quantity] = {}
        for one in entries:
            if one.key in table:
                raise InputError(f"The quantity {one.key} is there twice.")
            table[one.key] = one
        self._table: Mapping[str, Quantity] = MappingProxyType(table)

    def __getitem__(self, key: str) -> Quantity:
        return self._table[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)

    def __repr__(self) -> str:
        return f"Quantities({', '.join(self._table)})"

    def __hash__(self) -> int:
        return hash(tuple(self._table))

    def __reduce__(self) -> tuple[Any, ...]:
        return Quantities, (tuple(self.values()),)

    @property
    def keys_text(self) -> str:
        """The keys, for messages."""
        return ", ".join(self._table)

    def known(self, key: str) -> Quantity:
        """The quantity of a key; `InputError` where there is none."""
        if key not in self._table:
            raise InputError(f"There is no quantity {key!r}; one of {self.keys_text}.")
        return self._table[key]

    def extended(self, more: Iterable[Quantity] | Mapping[str, Quantity]) -> Quantities:
        """These and more; an entry of a key that is there takes its place."""
        added = more.values() if isinstance(more, Mapping) else more
        table = dict(self._table)
        for one in added:
            table[one.key] = one
        return Quantities(table.values())

    def subset(self, keys: Iterable[str]) -> Quantities:
        """Those of some keys, in this registry's order; `InputError` for a key that is not here."""
        wanted = {self.known(key).key for key in keys}
        return Quantities(one for one in self.values() if one.key in wanted)

    def with_limits(self, limits: Mapping[str, Mapping[str, Any]]) -> Quantities:
        """The same with some limits replaced: by key, tables of the fields of `Limits`."""
        return self.extended(
            replace(self.known(key), limits=replace(self.known(key).limits, **given))
            for key, given in limits.items()
        )


def check_span(name: str, span: Span) -> None:
    """Refuse two numbers that do not ascend."""
    if not (all(map(isfinite, span)) and span[0] < span[1]):
        raise InputError(f"{name} is {list(span)}; give two ascending numbers, [low, high].")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _of_values(values: Mapping[str, Any]) -> Quantity:
    return Quantity(**values)
