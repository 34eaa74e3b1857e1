"""Units in the column names that loggers write, and their conversion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.units import SPELLINGS, conversion, split_unit, unit_of


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("DO (%)", "DO", "%"),
        ("ODO % sat", "ODO", "%"),
        ("ODO mg/L", "ODO", "mg/L"),
        ("SpCond mS/cm", "SpCond", "mS/cm"),
        ("Cond µS/cm", "Cond", "µS/cm"),
        ("Specific Conductivity uS/cm @25", "Specific Conductivity", "µS/cm"),
        ("Temperature (F)", "Temperature", "°F"),
        ("Temp °C", "Temp", "°C"),
        ("water_temp_deg_c", "water temp", "°C"),
        ("Temp, °C (LGR S/N: 1, SEN S/N: 2)", "Temp", "°C"),
        ("Turb. [FNU]", "Turb.", "FNU"),
        ("BGA-PC µg/L", "BGA-PC", "µg/L"),
        ("pH", "pH", None),
        ("heading", "heading", None),
        ("YYMMDD", "YYMMDD", None),
    ],
)
def test_a_column_s_unit_is_read_from_its_name(name, stem, unit):
    assert split_unit(name) == (stem, unit)


@pytest.mark.parametrize(
    ("given_", "unit", "wanted", "expected"),
    [
        (68.0, "°F", "°C", 20.0),
        (273.15, "K", "°C", 0.0),
        (0.1086, "mS/cm", "µS/cm", 108.6),
        (0.0413, "S/m", "µS/cm", 413.0),
        (1.0, "ft", "m", 0.3048),
        # Molar mass of O2, 31.9988 g/mol.
        (250.0, "µmol/L", "mg/L", 7.9997),
    ],
)
def test_values_are_converted(given_, unit, wanted, expected):
    turns = conversion(unit, wanted, "dissolved_oxygen_mgl")
    assert turns(np.array([given_])) == pytest.approx([expected], abs=1e-9)


def test_what_is_another_kind_of_thing_is_not_converted():
    assert conversion("%", "mg/L", "dissolved_oxygen_mgl") is None
    assert conversion("mg/L", "°C") is None
    assert conversion("µmol/L", "mg/L", "nitrate_mgl") is None


@given(st.sampled_from(sorted(SPELLINGS)), st.sampled_from([" ", "_", " (", " [", ", "]))
def test_every_spelling_is_found_behind_a_name(unit, between):
    closing = {" (": ")", " [": "]"}.get(between, "")
    for spelling in SPELLINGS[unit]:
        assert split_unit(f"Sensor value{between}{spelling}{closing}")[1] == unit
        assert unit_of(spelling.upper()) == unit
