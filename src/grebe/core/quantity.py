"""The record of a quantity of the water, and a registry of such records.

A `Quantity` holds its names, units and limits; `Quantities` is an immutable, ordered registry.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from math import isfinite
from types import MappingProxyType
from typing import Any

from grebe.core.errors import InputError

# A key serves as a column name in SQLite, a variable name in NetCDF and part of file names.
_KEY = re.compile(r"[a-z][a-z0-9_]{0,59}")
# Other columns of the survey file's samples.
_RESERVED = frozenset({"fid", "geom", "time", "lat", "lon", "target_seq", "speed_mps"})
Span = tuple[float, float]


def inline(label: str) -> str:
    """A name as written within a sentence: lower case, except for spellings like pH or ORP."""
    first = label.split(" ", 1)[0]
    return label[:1].lower() + label[1:] if first[1:].islower() else label


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Possible and usual values of one quantity, in its unit.

    `fail_span`, `suspect_span`: gross range. `spike_suspect`, `spike_fail`: largest deviation from
    both neighbours to the same side. `rate_per_s`: steepest change. `flat_suspect_s`,
    `flat_fail_s`: how long a value may stay within `flat_tolerance`. An infinite limit is not
    tested.
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
    """Default limits of a quantity, from its span.

    A quantity that is not mapped describes the sonde, such as its depth or battery voltage; it may
    stay constant for any time.
    """
    if mapped:
        return Limits(fail_span=span, suspect_span=span)
    still = float("inf")
    return Limits(fail_span=span, suspect_span=span, flat_suspect_s=still, flat_fail_s=still)


@dataclass(frozen=True, kw_only=True)
class LakeStatistics:
    """Statistics of a quantity within a lake.

    Mean, standard deviation, range of the variogram as a share of the lake's extent, and share of
    the variance that is correlated.
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


# Units whose zero is a convention, so that ratios mean nothing.
INTERVAL_UNITS = ("°C", "mV", "")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One measured quantity.

    `key` is its column in the survey file and its variable in NetCDF. `labels` holds its name by
    language, English at least. `unit` is the unit of the column, `cf_unit` the same in UDUNITS.
    `standard_name` is its name in the CF table, empty if none is right. `span` is the gross range
    of values that are possible on a lake (QARTOD's gross range test fails outside it).
    `resolution` is the step in which common sondes report it; nothing is known below it.

    `columns` are regular expressions for the names of a track's columns; the first match wins.
    They see only lower-case letters, digits and the signs ° µ, or `before/this` with the name of
    the preceding column. `missing` are the numbers that stand for a missing value there. `limits`
    are those of quality control. `lake` gives its statistics in a simulated lake, None if it has
    none.

    `air_share`: in air the sensor reads less than this share of the record's median, None if that
    shows nothing. `on_sonde`: it settles, and comes out of the water, with the sonde. `mapped`: it
    is a property of the water and is mapped; any other quantity may stay constant. `colormap` is a
    name from matplotlib.
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

    @property
    def has_true_zero(self) -> bool:
        """Whether no water can have less than 0: not a temperature, a potential or a pH."""
        return self.unit not in INTERVAL_UNITS

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
        """Pickle and copy the labels as a plain dict: a read-only mapping cannot be pickled."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return _of_values, (values | {"labels": dict(self.labels)},)

    @property
    def label(self) -> str:
        """The English name."""
        return self.labels["en"]

    @property
    def inline(self) -> str:
        """The English name as written within a sentence: `temperature`, but `pH`."""
        return inline(self.label)

    def label_in(self, language: str) -> str:
        """The name in a language, or else in English."""
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
                # Defaults are left out, and infinities with them, which JSON cannot hold.
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
    """An immutable, ordered registry of quantities by key."""

    def __init__(self, entries: Iterable[Quantity] = ()) -> None:
        table: dict[str, Quantity] = {}
        for one in entries:
            if one.key in table:
                raise InputError(f"The quantity {one.key} is defined twice.")
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
        """The quantity with this key; raises `InputError` if there is none."""
        if key not in self._table:
            raise InputError(f"There is no quantity {key!r}; choose one of {self.keys_text}.")
        return self._table[key]

    def extended(self, more: Iterable[Quantity] | Mapping[str, Quantity]) -> Quantities:
        """These quantities and more; a new entry replaces one with the same key."""
        added = more.values() if isinstance(more, Mapping) else more
        table = dict(self._table)
        for one in added:
            table[one.key] = one
        return Quantities(table.values())

    def subset(self, keys: Iterable[str]) -> Quantities:
        """The quantities with these keys, in this registry's order.

        Raises `InputError` for an unknown key.
        """
        wanted = {self.known(key).key for key in keys}
        return Quantities(one for one in self.values() if one.key in wanted)

    def with_limits(self, limits: Mapping[str, Mapping[str, Any]]) -> Quantities:
        """The same quantities with some limits replaced: fields of `Limits`, by key."""
        return self.extended(
            replace(self.known(key), limits=replace(self.known(key).limits, **given))
            for key, given in limits.items()
        )


def check_span(name: str, span: Span) -> None:
    """Raise `InputError` unless a span is two finite, ascending numbers."""
    if not (all(map(isfinite, span)) and span[0] < span[1]):
        raise InputError(f"{name} is {list(span)}; give two ascending numbers, [low, high].")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _of_values(values: Mapping[str, Any]) -> Quantity:
    return Quantity(**values)
