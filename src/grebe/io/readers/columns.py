"""Which column of a table holds what, in which unit.

A column is found by its name, or named by the caller. The unit that its header names must be of the
quantity's own kind, and is then converted. Otherwise the column belongs to another quantity or to
none.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from grebe.core.errors import TrackError
from grebe.core.header_units import Unit, bracketed, is_at_25, parse_unit, split_header
from grebe.core.quantity import Quantity
from grebe.io.readers.counters import BARE

if TYPE_CHECKING:
    from grebe.core.quantities import Quantities

# Columns that describe another one.
_NOT_A_VALUE = re.compile(r"(_|\b)(qc|flag|quality|zone|unit|(?<!^ph_)units)$")
# Columns of quantities that were computed from a value.
_OF_A_VALUE = re.compile(r"(_|\b)(std|stdev|std[ _]?dev|sd|min|max|count|error)$")
# Names of the columns of time and place, first match wins; those of the quantities are in the
# registry. Only lower-case letters, digits and the signs of units are matched.
PLACE_AND_TIME: dict[str, tuple[str, ...]] = {
    "time": (r"gpstimestamp", r"(unix)?timestamp", r"time.*", r"datetime.*", r"unix.*"),
    "lat": (r"lat(itude)?(deg|dd)?", r".*latitud(e|ine)?.*", r"breite(ngrad)?"),
    "lon": (r"long?(itude)?(deg|dd)?", r"lng", r".*longitud(e|ine)?.*", r"lange(ngrad)?"),
}
# A column of dates beside one of the time of day, which the caller may name.
DATE = "date"
OXYGEN, SATURATION = "dissolved_oxygen_mgl", "oxygen_saturation_percent"
CONDUCTIVITY, CONDUCTANCE_25 = "conductivity_uscm", "specific_conductance_uscm"


@dataclass(frozen=True, kw_only=True)
class Column:
    """Where values are, and how they are converted.

    `name` is the header's, `unit` as the header spells it; `factor` and `offset` convert to the
    unit of the quantity. `by_solubility` is set if oxygen saturation and concentration have to be
    converted into each other. `unknown` is the text in brackets in the header if it is no known
    unit.
    """

    name: str
    unit: str = ""
    factor: float = 1.0
    offset: float = 0.0
    by_solubility: bool = False
    unknown: str = ""

    @property
    def converted(self) -> bool:
        """Whether the numbers change."""
        return self.by_solubility or self.factor != 1 or self.offset != 0


def find_columns(
    path: Path,
    header: Sequence[str],
    given: Mapping[str, str],
    quantities: Quantities,
    *,
    placed: bool = True,
) -> dict[str, Column]:
    """Return the column of each key that the table has; `TrackError` says what is missing or wrong.

    With `placed` the table must have latitude and longitude.
    """
    known = {*PLACE_AND_TIME, DATE, *quantities}
    for key, name in given.items():
        if key not in known:
            raise TrackError(
                f"{path}: a column is given for {key!r}, which is neither time, date, lat, lon nor "
                f"a quantity ({quantities.keys_text})."
            )
        if name not in header:
            raise TrackError(f"{path}: there is no column {name!r}; it has {', '.join(header)}.")
    found: dict[str, Column] = {}
    plain = _plain_names(header)
    values = {text: name for text, name in plain.items() if not _OF_A_VALUE.search(name.lower())}
    for key, expressions in PLACE_AND_TIME.items():
        name = given.get(key) or _first_match(expressions, plain)
        if name is None and key == "time":
            name = next((one for one in header if one.strip() in BARE), None)
        if name is not None:
            found[key] = Column(name=name)
    for key, quantity in quantities.items():
        column = (
            _given(path, given[key], quantity) if key in given else _found(header, values, quantity)
        )
        if column is not None:
            found[key] = column
    for key, what in (("lat", "latitude"), ("lon", "longitude")):
        if placed and key not in found:
            raise TrackError(
                f"{path}: no column looks like a {what}; say which one it is, as "
                f"{key}=NAME (columns: {', '.join(header)}).",
                settings=("columns",),
            )
    return found


def unit_of(quantity: Quantity) -> Unit | None:
    """Return the unit of a quantity's column, if it is a known one; a pH has one of its own."""
    return parse_unit(quantity.unit or ("pH" if quantity.key == "ph" else ""))


def _unit_behind(header: str, quantity: Quantity) -> tuple[str, Unit | None]:
    """Return the unit that a header names, as it spells it and as it applies to a quantity.

    Only for oxygen do moles and volumes have a mass.
    """
    spelled = split_header(header)[1]
    unit = parse_unit(spelled)
    return spelled, unit.of_oxygen() if unit and quantity.key in {OXYGEN, SATURATION} else unit


def _given(path: Path, name: str, quantity: Quantity) -> Column:
    """Return a column that the caller named: converted to the quantity's unit, or refused."""
    here = unit_of(quantity)
    spelled, there = _unit_behind(name, quantity)
    if there is None or here is None:
        return Column(name=name)
    if there.kind == here.kind:
        factor, offset = there.to(here)
        return Column(name=name, unit=spelled, factor=factor, offset=offset)
    if (quantity.key, there.kind) in {(OXYGEN, "percent"), (SATURATION, "mass in water")}:
        return Column(name=name, unit=spelled, factor=there.factor, by_solubility=True)
    raise TrackError(
        f"{path}: column {name!r} is in {spelled}, and {quantity.key} in {quantity.unit or '1'}: "
        "that is another quantity; name the column that holds it.",
        settings=("columns",),
    )


def _found(header: Sequence[str], plain: dict[str, str], quantity: Quantity) -> Column | None:
    """Return the column of a quantity: one in exactly its unit, or one that is converted to it."""
    here = unit_of(quantity)
    name = _first_match(quantity.columns, plain)
    if name is not None:
        spelled, there = _unit_behind(name, quantity)
        if there is None or here is None:
            return Column(name=name, unknown="" if here is None else bracketed(name))
        if there.kind == here.kind:
            factor, offset = there.to(here)
            return Column(name=name, unit=spelled, factor=factor, offset=offset)
    if here is None:
        return None
    for column in header:
        spelled, there = _unit_behind(column, quantity)
        if there is None or there.kind != here.kind or _speaks_of_another(column):
            continue
        if any(
            re.fullmatch(pattern, text)
            for pattern in quantity.columns
            if "/" not in pattern
            for text in _readings_of(column, spelled, here, quantity)
        ):
            factor, offset = there.to(here)
            return Column(name=column, unit=spelled, factor=factor, offset=offset)
    return None


def _readings_of(column: str, spelled: str, here: Unit, quantity: Quantity) -> list[str]:
    """Return a header as it would read in the quantity's own unit and without one.

    The patterns match these forms. `spelled` is the header's unit. A unit that holds at 25 °C is
    one of specific conductance, and never of plain conductivity.
    """
    base = _plain(split_header(column)[0])
    at_25 = [f"{base}25"] if here.kind == "conductivity" and is_at_25(spelled) else []
    if at_25 and quantity.key == CONDUCTIVITY:
        return []
    own = "percent" if here.kind == "percent" else _plain(quantity.unit)
    return [base + own, base, *at_25]


def _speaks_of_another(column: str) -> bool:
    return any(one.search(column.lower()) for one in (_NOT_A_VALUE, _OF_A_VALUE))


def _plain(text: str) -> str:
    # Remove accents, and turn the subscript digits of O₂ into digits.
    return re.sub(r"[^a-z0-9°µμ]", "", unicodedata.normalize("NFKD", text.lower()))


def _plain_names(header: Sequence[str]) -> dict[str, str]:
    """Return columns by their plain name, alone and after that of the column before.

    The latter has the form `before/this`.
    """
    plain: dict[str, str] = {}
    before = ""
    for name in header:
        this = _plain(name)
        if not _NOT_A_VALUE.search(name.lower()):
            plain.setdefault(this, name)
            plain.setdefault(f"{before}/{this}", name)
        before = this
    return plain


def _first_match(expressions: Sequence[str], plain: dict[str, str]) -> str | None:
    for expression in expressions:
        for name, column in plain.items():
            if ("/" in name) == ("/" in expression) and re.fullmatch(expression, name):
                return column
    return None
