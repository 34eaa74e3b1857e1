"""Headers are split into names and units; oxygen's solubility is that of published tables."""

import pytest

from grebe.core.header_units import parse_unit, split_header
from grebe.core.oxygen import oxygen_solubility_mgl


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("SpCond mS/cm", "SpCond", "mS/cm"),
        ("DO (%)", "DO", "%"),
        ("Temperature (F)", "Temperature", "F"),
        ("Temp, °C (LGR S/N: 1, SEN S/N: 1)", "Temp", "°C"),
        ("RDO Concentration (mg/L) (543925)", "RDO Concentration", "mg/L"),
        ("ODO % sat", "ODO", "% sat"),
        ("ODO % local", "ODO", "% local"),
        ("Date Time, GMT-04:00", "Date Time, GMT-04:00", ""),
        ("pH", "pH", ""),
        ("temp_f", "temp", "f"),
        ("target_m", "target_m", ""),
    ],
)
def test_a_header_is_a_name_and_a_unit(header, name, unit):
    assert split_header(header) == (name, unit)


@pytest.mark.parametrize(
    ("value", "unit", "other", "is_"),
    [(68.0, "°F", "°C", 20.0), (0.1, "mS/cm", "µS/cm", 100.0), (10.0, "ft", "m", 3.048)],
)
def test_values_are_converted(value, unit, other, is_):
    factor, offset = parse_unit(unit).to(parse_unit(other))
    assert factor * value + offset == pytest.approx(is_)


def test_another_kind_is_not_converted():
    with pytest.raises(ValueError, match="percent is not mass"):
        parse_unit("%").to(parse_unit("mg/L"))


@pytest.mark.parametrize(
    ("degc", "mgl"),
    # Standard Methods, table 4500-O:I, fresh water at 101.325 kPa.
    [(0, 14.621), (5, 12.770), (10, 11.288), (15, 10.084), (20, 9.092), (25, 8.263), (30, 7.559)],
)
def test_oxygen_dissolves_as_tabled(degc, mgl):
    assert float(oxygen_solubility_mgl(degc)) == pytest.approx(mgl, abs=1.5e-3)
