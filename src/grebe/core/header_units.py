"""Units in the column headers that loggers write, and their conversion.

A header such as `SpCond mS/cm`, `DO (%)`, `Temp, °C (LGR S/N: 1)` or `depth_ft` is a name and a
unit. A unit is a scale of one kind of measurement; `factor * value + offset` converts a value to
the kind's base scale.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from grebe.core.units import OXYGEN_G_PER_MOL, OXYGEN_MG_PER_ML


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A scale: the `kind` of measurement, and the conversion to that kind's base scale."""

    kind: str
    factor: float = 1.0
    offset: float = 0.0

    def to(self, other: Unit) -> tuple[float, float]:
        """Factor and offset that convert a value in this unit to another of the same kind.

        Raises `ValueError` if the kinds differ.
        """
        if self.kind != other.kind:
            raise ValueError(f"{self.kind} is not {other.kind}")
        return self.factor / other.factor, (self.offset - other.offset) / other.factor

    def of_oxygen(self) -> Unit:
        """Unit of oxygen's mass in water that corresponds to one of moles or of gas volume.

        A kilogram of fresh water is taken as a litre. Any other unit is returned unchanged.
        """
        mgl = _OXYGEN_MGL.get(self.kind)
        return self if mgl is None else Unit(kind="mass in water", factor=mgl * self.factor)


# Oxygen [mg/L] for one unit of a kind's base scale.
_OXYGEN_MGL = {
    "amount in water": OXYGEN_G_PER_MOL / 1000,
    "amount in mass": OXYGEN_G_PER_MOL / 1000,
    "gas in water": OXYGEN_MG_PER_ML,
}

# Ratio of a temperature on the scale of 1968 to that on the scale of 1990 [°C].
IPTS_68 = 1.00024

# Keyed by spelling: lower case, no blanks, u for micro, no degree sign. Bases: Celsius, µS/cm,
# mg/L, µmol/L, µmol/kg, mL/L, percent, NTU, RFU, QSU, mV, m, dbar, PSU, degrees. A prefix before
# a comma is the scale or the kind of water, as in Sea-Bird's names.
_UNITS: dict[str, Unit] = {}


def _define(kind: str, factor: float, *spellings: str, offset: float = 0.0) -> None:
    unit = Unit(kind=kind, factor=factor, offset=offset)
    _UNITS.update(dict.fromkeys(spellings, unit))


_define("temperature", 1, "c", "degc", "degreec", "degreesc", "celsius", "degreecelsius", "oc")
_define("temperature", 1, "its-90,degc", "its90,degc")
_define("temperature", 1 / IPTS_68, "ipts-68,degc", "ipts68,degc")
_define("temperature", 5 / 9, "its-90,degf", offset=-160 / 9)
_define("temperature", 5 / 9, "f", "degf", "fahrenheit", "degreesf", offset=-160 / 9)
_define("temperature", 1, "k", "kelvin", offset=-273.15)
_define(
    "conductivity",
    1,
    "us/cm",
    "uscm",
    "uscm-1",
    "us",
    "microsiemenspercentimeter",
    "umho/cm",
    "umhos/cm",
)
_define("conductivity", 1e3, "ms/cm", "mscm", "mscm-1", "ms", "millisiemenspercentimeter")
_define("conductivity", 1e3, "ds/m", "dsm-1", "mmho/cm", "mmhos/cm")
_define("conductivity", 10, "ms/m")
_define("conductivity", 1e4, "s/m", "sm-1")
_define("mass in water", 1, "mg/l", "mgl", "mgl-1", "ppm", "g/m3", "milligramsperliter")
_define("mass in water", 1e-3, "ug/l", "ugl", "ugl-1", "ppb", "mg/m3")
_define("amount in water", 1, "umol/l", "umoll", "umoll-1", "umol/dm3", "um", "mmol/m3")
_define("amount in mass", 1, "umol/kg", "umolkg", "umolkg-1")
_define("gas in water", 1, "ml/l", "mll-1", "mlperl")
_define(
    "percent",
    1,
    "%",
    "%sat",
    "percent",
    "pct",
    "percentsat",
    "%saturation",
    "%satur",
    "%l",
    "%-l",
    "%local",
    "%cb",
)
_define("turbidity", 1, "ntu", "ntus", "fnu", "ftu", "nephelometricturbidityunits", "formazinunits")
_define("fluorescence", 1, "rfu")
_define("quinine", 1, "qsu")
_define("voltage", 1, "mv", "millivolts")
_define("voltage", 1e3, "v", "volt", "volts")
_define("length", 1, "m", "meter", "meters", "metre", "metres")
_define("length", 1, "saltwater,m", "freshwater,m")
_define("length", 0.3048, "ft", "feet", "foot", "saltwater,ft", "freshwater,ft")
_define("length", 0.01, "cm")
_define("pressure", 1, "dbar", "decibar", "db")
_define("pressure", 0.6894757, "psi", "psia", "psig")
_define("pressure", 10, "bar")
_define("pressure", 0.01, "mbar", "hpa")
_define("pressure", 0.1, "kpa")
_define("salinity", 1, "psu", "ppt", "pss", "g/kg", "practicalsalinityscale")
_define("acidity", 1, "ph", "phunits", "units", "unit", "su")
_define("angle", 1, "deg", "degrees", "dd")
_define("angle", 1e-7, "1e-7deg", "1e7", "dege7", "e7", "degx1e7")
_define("speed", 1, "m/s", "ms-1", "meterspersecond")

# Serial numbers and labels in a logger's export, which are not units.
_SERIAL = re.compile(r"\s*\((LGR|SEN|S/N|LBL|#)[^)]*\)|\s*\(\d{4,}\)", re.IGNORECASE)
_BRACKETS = re.compile(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]")


# The reference temperature of a unit: `mS/cm @25°C`.
_AT = re.compile(r"(@|at)\d+(deg)?c?$")


# The reference temperature of a specific conductance.
_AT_25 = re.compile(r"(@|at)25(deg|c|$)")


def parse_unit(text: str) -> Unit | None:
    """The unit with this spelling; None if there is none."""
    return _UNITS.get(_AT.sub("", _plain(text)))


def is_at_25(text: str) -> bool:
    """Whether the spelling of a unit refers it to 25 °C."""
    return _AT_25.search(_plain(text)) is not None


def _plain(text: str) -> str:
    plain = text.lower().translate(str.maketrans("µμ", "uu", "° \t_"))
    return plain.replace("·", "").replace("^", "")


def bracketed(header: str) -> str:
    """Text in the last brackets of a header, ignoring serial numbers; empty without brackets."""
    found = _BRACKETS.findall(_SERIAL.sub("", header))
    return found[-1] if found else ""


def split_header(header: str) -> tuple[str, str]:
    """A column's name and the spelling of its unit, empty if the header has none."""
    text = _SERIAL.sub("", header.replace("\N{DEGREE CELSIUS}", "°C")).strip()
    for found in _BRACKETS.finditer(text):
        if parse_unit(found[1]):
            return (text[: found.start()] + text[found.end() :]).strip(" ,_"), found[1]
    for mark in (",", " ", "_", "-"):
        # Take the longest ending that is a unit and follows a name.
        places = [place.start() for place in re.finditer(re.escape(mark), text)]
        for place in places:
            name, unit = text[:place].strip(" ,_"), text[place + 1 :].strip()
            # One letter after `_` or `-` is a unit only for a temperature: `x_m` may be anything.
            lone = mark in "_-" and len(unit) == 1 and "temp" not in name.lower()
            if name and not lone and parse_unit(unit):
                return name, unit
    if text.endswith("%") and len(text) > 1:
        return text[:-1].strip(), "%"
    return text, ""
