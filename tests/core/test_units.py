"""Units as instruments spell them, and their conversion."""

import numpy as np
import pytest

from grebe.core.header_units import parse_unit
from grebe.core.units import CONVERSIONS, SPELLINGS, conversion, unit_of


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


@pytest.mark.parametrize("unit", SPELLINGS)
def test_every_spelling_is_known_in_capitals_and_with_spaces_too(unit):
    for spelling in SPELLINGS[unit]:
        assert unit_of(spelling) == unit_of(spelling.upper()) == unit_of(f" {spelling} ") == unit


def test_what_headers_spell_alike_is_converted_alike():
    """Instruments and column headers are read by different tables, which must not disagree."""
    compared = 0
    for given_, wanted in CONVERSIONS:
        there = parse_unit(wanted)
        for spelling in SPELLINGS[given_]:
            here = parse_unit(spelling)
            if here is None or here.kind != there.kind:
                continue
            factor, offset = here.to(there)
            turns = conversion(given_, wanted)
            if turns is not None:
                compared += 1
                assert (turns.factor, turns.offset) == pytest.approx((factor, offset)), spelling
    assert compared > 30
    for unit, spellings in SPELLINGS.items():
        known = [found for found in map(parse_unit, (unit, *spellings)) if found is not None]
        assert all(found == known[0] for found in known), unit
