"""The five quantities of the water that Grebe measures and maps.

The paper's map is F: Omega -> R^5 (remark 11); this table is the R^5.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One measured quantity.

    `key` is its column in the survey file and its variable in NetCDF; `unit` is the unit
    of the column, `cf_unit` the same in UDUNITS; `span` the gross range in which a value
    on a lake is possible at all (QARTOD's gross range test fails outside it); `resolution` the
    step in which common sondes report it, below which nothing is known.
    """

    key: str
    label: str
    unit: str
    cf_unit: str
    standard_name: str
    span: tuple[float, float]
    resolution: float


QUANTITIES: tuple[Quantity, ...] = (
    Quantity(
        key="temperature_degc",
        label="Temperature",
        unit="°C",
        cf_unit="degree_Celsius",
        standard_name="sea_water_temperature",
        span=(-2.0, 45.0),
        resolution=0.001,
    ),
    Quantity(
        key="dissolved_oxygen_mgl",
        label="Dissolved oxygen",
        unit="mg/L",
        cf_unit="mg L-1",
        standard_name="mass_concentration_of_oxygen_in_sea_water",
        span=(0.0, 30.0),
        resolution=0.01,
    ),
    Quantity(
        key="ph",
        label="pH",
        unit="",
        cf_unit="1",
        standard_name="sea_water_ph_reported_on_total_scale",
        span=(2.0, 12.0),
        resolution=0.01,
    ),
    Quantity(
        key="conductivity_uscm",
        label="Conductivity",
        unit="µS/cm",
        cf_unit="uS cm-1",
        standard_name="sea_water_electrical_conductivity",
        span=(1.0, 60000.0),
        resolution=0.1,
    ),
    Quantity(
        key="turbidity_ntu",
        label="Turbidity",
        unit="NTU",
        cf_unit="1",
        standard_name="sea_water_turbidity",
        span=(0.0, 4000.0),
        resolution=0.01,
    ),
)

QUANTITY_KEYS: tuple[str, ...] = tuple(quantity.key for quantity in QUANTITIES)
