"""Formats as their makers print them, and the handling of damaged lines."""

import math
import struct
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.links.instruments.decoding import RegisterDecoder, TextDecoder
from grebe.links.instruments.pretend import (
    SimulatedModbusInstrument,
    crc16,
    simulated_instrument,
    typical_water,
)
from grebe.links.instruments.profile import profile_named, profile_names


def decoder(name):
    return TextDecoder(profile_named(name), BUILTIN)


@pytest.mark.parametrize(
    ("profile", "line", "values"),
    [
        # YSI 6-series manual, appendix N.
        (
            "ysi-6-series",
            b"$YSI,1,4.44,7,10,18,7.00*4E",
            {"temperature_degc": 4.44, "specific_conductance_uscm": 10.0, "ph": 7.0},
        ),
        # Valeport Hyperion manual, section 6.2.
        (
            "valeport-hyperion",
            b"$PVHY2,01,8,0.48705,0.012,NTU,141.65588,0.023,NTU,M1,*6D",
            {"turbidity_ntu": 0.48705},
        ),
        (
            "valeport-hyperion",
            b"$PVHY2,01,1,0.816,,ug/l,,,,C02,*24",
            {"chlorophyll_ugl": 0.816},
        ),
        ("atlas-ph", b"8.12\r", {"ph": 8.12}),
        ("atlas-do", b"8.40,98.2", {"dissolved_oxygen_mgl": 8.4}),
    ],
)
def test_a_line_of_the_manual_is_read(profile, line, values):
    said = decoder(profile).take(line)
    assert said.values == pytest.approx(values)
    assert said.stamp is None


def test_the_fields_of_an_exo_are_those_that_it_listed():
    exo = decoder("ysi-exo")
    assert not exo.list_codes(b"# para")
    assert exo.list_codes(b"1 7 18 211 999")
    said = exo.take(b"20.247 108.64 7.347 94.84 3.1")
    assert said.values == pytest.approx(
        {
            "temperature_degc": 20.247,
            "specific_conductance_uscm": 108.64,
            "ph": 7.347,
            "oxygen_saturation_percent": 94.84,
        }
    )
    assert list(exo.counts.unused) == ["code 999"]
    # Another sensor was plugged in, so the fields are no longer those that were listed.
    assert exo.take(b"20.247 108.64 7.347") is None


@pytest.mark.parametrize(
    "line",
    [
        b"$YSI,1,4.45,7,10,18,7.00*4E",
        b"$YSI,1,4.44,7,10,18,7.00",
        b"$YSI,1,4.4",
        b"\xff\x00\x9b$YSI,1,4.44*4E",
        b"",
        b"#",
    ],
)
def test_a_damaged_line_is_no_reading(line):
    sonde = decoder("ysi-6-series")
    assert sonde.take(line) is None
    assert sonde.counts.readings == 0


@given(st.sampled_from(profile_names()), st.binary(max_size=80))
def test_no_noise_on_a_line_is_an_error(name, noise):
    profile = profile_named(name)
    if profile.text is None:
        return
    said = TextDecoder(profile, BUILTIN).take(noise)
    assert said is None or all(map(math.isfinite, said.values.values()))


@dataclass
class Held:
    """Registers of a pretend instrument, read as a client would."""

    instrument: SimulatedModbusInstrument
    first: int
    asked: list = field(default_factory=list)

    def read(self, register, count):
        self.asked.append((register, count))
        words = self.instrument.registers()
        return [words.get(register - self.first + i, 0) for i in range(count)]


@pytest.mark.parametrize("name", [n for n in profile_names() if profile_named(n).modbus])
def test_registers_are_read_back_as_they_were_measured(name):
    profile = profile_named(name)
    held = Held(
        SimulatedModbusInstrument(profile, lambda _: typical_water(3.0)), profile.modbus.first
    )

    def as_float(words):
        high, low = words if profile.modbus.order == "ABCD" else reversed(words)
        return struct.unpack(">f", struct.pack(">HH", high, low))[0]

    said = RegisterDecoder(profile, BUILTIN).take(held.read, as_float)
    truth = typical_water(3.0)
    assert set(said.values) == set(profile.keys)
    for key, value in said.values.items():
        assert value == pytest.approx(truth.get(key, 0.0), rel=1e-6)


def test_the_sum_of_modbus_is_that_of_its_specification():
    """The sum of the request 01 03 00 00 00 02 is C4 0B."""
    assert crc16(bytes.fromhex("010300000002")) == bytes.fromhex("C40B")


@pytest.mark.parametrize("name", [n for n in profile_names() if profile_named(n).text])
def test_a_pretend_instrument_speaks_what_its_profile_reads(name):
    profile = profile_named(name)
    instrument = simulated_instrument(profile, lambda _: typical_water(3.0))
    ours = TextDecoder(profile, BUILTIN)
    if profile.text.list_codes:
        assert ours.list_codes(instrument.receive(profile.text.list_codes.encode()))
    said = ours.take(instrument.line().encode())
    truth = typical_water(3.0)
    for key, value in said.values.items():
        assert value == pytest.approx(truth.get(key, 0.0), abs=0.01, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("title = 'x'\nsource = 'y'", "give either"),
        ("title = 'x'\nsource = 'y'\n[text]", "names a quantity"),
        ("title = 'x'\nsource = 'y'\n[text]\ncolums = []", "colums"),
        (
            "title='x'\nsource='y'\n[text]\ncolumns = [{ at = 1, quantity = 'ph', unit = 'm' }]",
            "'m' cannot be converted",
        ),
        (
            "title = 'x'\nsource = 'y'\n[text]\ncolumns = [{ at = 1, quantity = 'smell' }]",
            "no quantity 'smell'",
        ),
        ("title = 'x'\nsource = 'y'\n[text]\nwidth = 'many'", "width"),
        ("title =", "own.toml"),
    ],
)
def test_a_profile_that_cannot_be_followed_is_refused_with_the_reason(tmp_path, text, words):
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        profile_named(str(path))


def test_a_user_s_profile_reads_her_own_logger(tmp_path):
    path = tmp_path / "buoy.toml"
    path.write_text(
        """
title = "The buoy"
source = "our own"
[text]
delimiter = ";"
width = 4
columns = [
  { at = 3, quantity = "temperature_degc", unit = "°F" },
  { at = 4, quantity = "conductivity_uscm", unit = "mS/cm" },
]
stamp = { at = [1, 2], format = "%d.%m.%Y %H:%M:%S" }
"""
    )
    said = TextDecoder(profile_named(str(path)), BUILTIN).take(b"01.08.2026;12:00:00;68;0.42")
    assert said.values == pytest.approx({"temperature_degc": 20.0, "conductivity_uscm": 420.0})
    assert said.stamp == 1_785_585_600.0
