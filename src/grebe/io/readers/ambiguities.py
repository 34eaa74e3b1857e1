"""Notes on a column that may mean something other than what it is taken as."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TYPE_CHECKING

from grebe.core.header_units import parse_unit, split_header
from grebe.io.readers.columns import CONDUCTANCE_25, CONDUCTIVITY, OXYGEN, SATURATION, Column

if TYPE_CHECKING:
    from grebe.core.quantity import Quantity

# Nitrate is stored as its nitrogen, which a header shows by a separate N.
NITRATE = "nitrate_mgl"
_OF_NITROGEN = re.compile(r"nitrogen|(?<![a-z])n(?![a-z])|no3n|nitrate_?mgl")
# Loggers give these quantities in units that differ by a factor of a thousand, or measure something
# else altogether, so a header without a unit leaves a doubt.
_OF_MANY_UNITS = frozenset({CONDUCTIVITY, CONDUCTANCE_25, OXYGEN})
# A conductivity that the meter may refer to 25 °C without saying so.
_EC = re.compile(r"ec|cond")
# A percentage of what the water can take up at the pressure of the day and the place.
_LOCAL = re.compile(r"%[ -]*(local|l|cb)\b")


def ambiguities(column: Column, quantity: Quantity, found: Collection[str]) -> list[str]:
    """Return the doubts about a column that is taken as a quantity.

    `found` are the keys of everything that the table has.
    """
    return [
        f"{column.name}: {text}"
        for text in (*_of_unit(column, quantity), *_of_meaning(column, quantity, found))
    ]


def _of_unit(column: Column, quantity: Quantity) -> list[str]:
    if column.unknown:
        unit = quantity.unit or "its unit"
        return [f"{column.unknown!r} is not a known unit; taken as {unit}"]
    if quantity.key in _OF_MANY_UNITS and not column.unit and not _ends_in_unit(column, quantity):
        return [f"its header names no unit; taken as {quantity.unit}"]
    if re.search("f[nt]u", column.unit.lower()):
        return [
            "kept as it is, under NTU: the scales of infrared and of white light agree only for "
            "formazin"
        ]
    return []


def _of_meaning(column: Column, quantity: Quantity, found: Collection[str]) -> list[str]:
    key, name = quantity.key, column.name.lower()
    if key == NITRATE and not _OF_NITROGEN.search(name):
        return ["taken as nitrate's nitrogen; if it counts the whole ion, it is 4.43 times as much"]
    stem = re.sub(r"[^a-z0-9]", "", split_header(name)[0])
    if key == CONDUCTIVITY and _EC.fullmatch(stem) and CONDUCTANCE_25 not in found:
        return [
            "taken as the conductivity at the water's own temperature; if its meter refers it to "
            f"25 °C, name it so, as {CONDUCTANCE_25}=NAME"
        ]
    if key == SATURATION and _LOCAL.search(name):
        return ["a percentage of saturation at the local pressure of the air, not at 1013.25 hPa"]
    unit = parse_unit(column.unit)
    if key in {OXYGEN, SATURATION} and unit is not None and unit.kind == "amount in mass":
        return ["a litre is taken as a kilogram; of sea water it is 2 to 3 % more"]
    return []


def _ends_in_unit(column: Column, quantity: Quantity) -> bool:
    """Return whether a name ends in the quantity's unit, as in `spcond_us_cm`."""
    plain = [
        re.sub(r"[^a-z]", "", text.lower().replace("µ", "u").replace("μ", "u"))
        for text in (column.name, quantity.unit)
    ]
    return plain[0].endswith(plain[1])
