"""Units as instruments and their profiles spell them, and conversions between them.

The difficulty with these units is their spelling, not their arithmetic: `uS/cm`, `µS/cm@25`,
`% sat`, `degC`. So the spellings are a table, and a conversion is a factor and an offset.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Each unit by its name in the registry of quantities, with its spellings in lower case, with u for
# micro and without spaces, dots, carets and underscores.
SPELLINGS: dict[str, tuple[str, ...]] = {
    "°C": ("°c", "degc", "c", "degreesc", "celsius", "degreecelsius", "degcelsius"),
    "°F": ("°f", "degf", "f", "degreesf", "fahrenheit", "degfahrenheit"),
    "K": ("k", "kelvin", "degk"),
    "mg/L": ("mg/l", "mgl", "mgl-1", "mg/lt", "mg/liter", "mg/litre", "mgperl", "mgn/l", "mg/l-n"),
    "ppm": ("ppm",),
    "g/L": ("g/l", "gl-1"),
    "µg/L": ("ug/l", "ugl", "ugl-1", "ugperl", "mg/m3"),
    "ppb": ("ppb",),
    "µmol/L": ("umol/l", "umoll", "umol", "um", "micromol/l", "mmol/m3"),
    "µmol/kg": ("umol/kg", "umolkg", "umolkg-1"),
    "ml/L": ("ml/l", "mll", "mll-1", "mlperl"),
    "%": ("%", "%sat", "sat", "percent", "pct", "%saturation", "percentsat", "%local", "%airsat"),
    "µS/cm": ("us/cm", "uscm", "uscm-1", "us/cm@25", "us/cm@25°c", "umho/cm", "umhos/cm"),
    "mS/cm": ("ms/cm", "mscm", "mscm-1", "ms/cm@25", "ms/cm@25°c", "mmho/cm"),
    "S/m": ("s/m", "sm-1", "siemens/m"),
    "mS/m": ("ms/m",),
    "NTU": ("ntu", "ntus"),
    "FNU": ("fnu", "fnus"),
    "FTU": ("ftu",),
    "RFU": ("rfu", "rfus"),
    "QSU": ("qsu", "ppbqse"),
    "mV": ("mv", "millivolt", "millivolts"),
    "V": ("v", "volt", "volts"),
    "PSU": ("psu", "pss", "pss-78", "ppt", "‰", "g/kg"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm",),
    "mm": ("mm",),
    "ft": ("ft", "feet", "foot"),
    "dbar": ("dbar",),
}  # fmt: skip
_NAMES = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings}

# Molar mass of oxygen [g/mol], the only substance that loggers give in moles here.
OXYGEN_G_PER_MOL = 31.9988
# Mass of a millilitre of oxygen gas at 0 °C and 1013.25 hPa [mg], as used by Sea-Bird and ICES.
OXYGEN_MG_PER_ML = 1.42903


@dataclass(frozen=True, kw_only=True)
class Conversion:
    """y = factor x + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert values (n,) to the other unit."""
        return self.factor * values + self.offset


SAME = Conversion()
CONVERSIONS: dict[tuple[str, str], Conversion] = {
    ("°F", "°C"): Conversion(factor=5 / 9, offset=-160 / 9),
    ("K", "°C"): Conversion(offset=-273.15),
    # Fresh water weighs a kilogram a litre.
    ("ppm", "mg/L"): SAME,
    ("g/L", "mg/L"): Conversion(factor=1000.0),
    ("µg/L", "mg/L"): Conversion(factor=0.001),
    ("ppb", "µg/L"): SAME,
    ("mg/L", "µg/L"): Conversion(factor=1000.0),
    ("ppb", "QSU"): SAME,
    ("µmol/L", "mg/L"): Conversion(factor=OXYGEN_G_PER_MOL / 1000.0),
    # A kilogram of fresh water is a litre.
    ("µmol/kg", "mg/L"): Conversion(factor=OXYGEN_G_PER_MOL / 1000.0),
    ("ml/L", "mg/L"): Conversion(factor=OXYGEN_MG_PER_ML),
    ("mS/cm", "µS/cm"): Conversion(factor=1000.0),
    ("S/m", "µS/cm"): Conversion(factor=10_000.0),
    ("mS/m", "µS/cm"): Conversion(factor=10.0),
    # All are calibrated with formazin, but measured with light of different colours.
    ("FNU", "NTU"): SAME,
    ("FTU", "NTU"): SAME,
    ("V", "mV"): Conversion(factor=1000.0),
    ("cm", "m"): Conversion(factor=0.01),
    ("mm", "m"): Conversion(factor=0.001),
    ("ft", "m"): Conversion(factor=0.3048),
}
# Moles and volumes are converted to masses for oxygen only.
_OF_OXYGEN_ALONE = ("µmol/L", "µmol/kg", "ml/L")


def unit_of(text: str) -> str | None:
    """The registry's name of the unit that a text spells; None if it is no unit."""
    return _NAMES.get(_plain(text))


def conversion(given: str, wanted: str, key: str = "") -> Conversion | None:
    """The conversion of one unit to another; None if there is none."""
    if given == wanted:
        return SAME
    if given in _OF_OXYGEN_ALONE and "oxygen" not in key:
        return None
    return CONVERSIONS.get((given, wanted))


def _plain(text: str) -> str:
    small = unicodedata.normalize("NFKC", text).replace("º", "°").lower()
    return re.sub(r"[\s._^]", "", small.replace("μ", "u").replace("µ", "u"))
