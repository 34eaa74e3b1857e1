"""Solubility of oxygen in water.

Benson and Krause (1984), equations 24, 31 and 32, as the U.S. Geological Survey has used them
since its Office of Water Quality technical memorandum 2011.03: concentration at equilibrium with
moist air at a temperature, a salinity and a pressure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

STANDARD_ATM_HPA = 1013.25
KELVIN = 273.15


def oxygen_solubility_mgl(
    temperature_degc: Array | float,
    salinity: Array | float = 0.0,
    pressure_hpa: Array | float = STANDARD_ATM_HPA,
) -> Array:
    """Dissolved oxygen at saturation [mg/L], in the broadcast shape of the arguments.

    `temperature_degc` is 0 to 40 °C, `salinity` 0 to 40 (practical). `pressure_hpa` is that of the
    air at the water, not reduced to sea level.
    """
    t = np.asarray(temperature_degc, dtype=float)
    kelvin = t + KELVIN
    fresh = np.exp(
        -139.34411
        + 1.575701e5 / kelvin
        - 6.642308e7 / kelvin**2
        + 1.243800e10 / kelvin**3
        - 8.621949e11 / kelvin**4
    )
    salt = np.exp(-np.asarray(salinity) * (0.017674 - 10.754 / kelvin + 2140.7 / kelvin**2))
    atm = np.asarray(pressure_hpa, dtype=float) / STANDARD_ATM_HPA
    vapour = np.exp(11.8571 - 3840.70 / kelvin - 216961.0 / kelvin**2)
    theta = 0.000975 - 1.426e-5 * t + 6.436e-8 * t**2
    air = (atm - vapour) * (1 - theta * atm) / ((1 - vapour) * (1 - theta))
    return fresh * salt * air
