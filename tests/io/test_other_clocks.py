"""Clocks, names and units of foreign loggers are respected and reported."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from grebe.core.errors import TrackError
from grebe.io.readers.clock import read_times
from grebe.io.readers.nmea_log import read_nmea
from grebe.io.readers.track import RawTrack, read_readings, read_track
from grebe.io.readers.zones import zone_of

MOMENT = datetime(2024, 7, 18, 9, 15, tzinfo=UTC).timestamp()


def seconds(cell: str, header: str = "") -> float:
    """Return one time in seconds."""
    read = read_times([cell] * 3, header)
    assert read is not None
    return float(read[0][0])


@pytest.mark.parametrize(
    "cell",
    [
        "18-Jul-2024 09:15:00", "18 Jul 2024 09:15:00", "Jul 18 2024 09:15:00",
        "18-Jul-24 09:15", "1721294100,000", "2024-07-18 02:15:00 PDT",
        "07/18/2024 05:15:00 AM EDT", "18.07.2024 11:15 MESZ", "18/07/2024 09:15:00 a. m.",
        "18/07/2024 9:15 a.m.",
    ],
)  # fmt: skip
def test_a_time_is_the_same_in_every_format(cell: str) -> None:
    assert seconds(cell) == MOMENT


def test_days_of_a_spreadsheet_may_have_a_comma() -> None:
    read = read_times(["45491,38541667", "45491,38542824"])
    assert read is not None
    assert read[0] == pytest.approx([MOMENT, MOMENT + 1], abs=1e-2)


@pytest.mark.parametrize(
    ("header", "hours"), [("Time (PDT)", 7), ("Date_Time_CEST", -2), ("Time", 0), ("RESTORED", 0)]
)
def test_letters_in_a_header_are_the_zone(header: str, hours: float) -> None:
    assert seconds("2024-07-18 09:15:00", header) == MOMENT + hours * 3600


def test_letters_that_change_are_not_taken_for_one_zone() -> None:
    assert read_times(["07/18/2024 09:15 EDT", "07/18/2024 09:16 EST"]) is None


def test_a_leading_two_digit_year_is_recognised() -> None:
    read = read_times(["24/07/18 09:15:00"] * 3)
    assert read is not None
    assert "taken as day, month and year, 24 July 2018" in read[1][0]
    assert seconds("24/07/18 09:15:00", "Date (YY/MM/DD)") == MOMENT
    plain = read_times(["31/07/2024 09:15:00"] * 3)
    assert plain is not None
    assert plain[1] == ["times without a zone: taken as UTC"]


def read(path: Path, header: str, *cells: str, before: str = "", zone: str = "") -> RawTrack:
    """Read the track of a boat that goes north, with the same cells in each row."""
    rows = [",".join((f"{46.5 + 1e-5 * k:.6f}", "8.0", *cells)) for k in range(20)]
    path.write_text("\n".join([*before.splitlines(), f"Lat,Long,{header}", *rows]) + "\n")
    return read_track(path, zone=zone_of(zone) if zone else None)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "track.csv"


def test_the_offset_before_the_header_is_the_zone_unless_another_is_given(path: Path) -> None:
    cells, before = ("2024-07-18 11:15:00", "18.5"), "Report\nTime Offset = 02:00:00\nLog Data"
    track = read(path, "Date Time,Temperature (C)", *cells, before=before)
    assert track.times is not None
    assert track.times[0] == MOMENT
    assert "Time Offset = 02:00:00: the zone of the times" in track.notes
    given = read(path, "Date Time,Temperature (C)", *cells, before=before, zone="UTC")
    assert given.times is not None
    assert given.times[0] == MOMENT + 7200


def test_a_line_of_units_gives_the_order_of_the_date(path: Path) -> None:
    rows = [f'070824,0915{k:02d},18.5,"",{46.5 + 1e-5 * k:.6f},8.0' for k in range(20)]
    lines = ["Date,Time,Temp,,Lat,Long", "MMDDYY,HHMMSS,C,,deg,deg", *rows]
    path.write_text("\n".join(lines) + "\n")
    track = read_track(path)
    assert track.times is not None
    assert track.times[0] == datetime(2024, 7, 8, 9, 15, tzinfo=UTC).timestamp()


def test_a_date_and_a_time_in_two_columns_can_be_named(path: Path) -> None:
    lines = ["Lat,Lon,Dia,Momento,Temp (C)", *["46.5,8.0,18.07.2024,09:15:00,18.5"] * 3]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(TrackError, match="none of the time of day; name it, as time=NAME"):
        read_track(path, {"date": "Dia"})
    read_ = read_readings(path, {"date": "Dia", "time": "Momento"})
    assert read_.times is not None
    assert read_.times[0] == MOMENT
    assert not read_.unused


@pytest.mark.parametrize(
    ("name", "cell", "key", "value"),
    [
        ("Wassertemperatur [°C]", "18.5", "temperature_degc", 18.5),
        ("Température (°C)", "18.5", "temperature_degc", 18.5),
        ("Oxygène dissous (mg/L)", "8.5", "dissolved_oxygen_mgl", 8.5),
        ("Leitfähigkeit [mS/cm]", "0.31", "conductivity_uscm", 310.0),
        ("Conductivity (dS/m)", "0.31", "conductivity_uscm", 310.0),
        ("Trübung [FNU]", "3.5", "turbidity_ntu", 3.5),
        ("FNU", "3.5", "turbidity_ntu", 3.5),
        ("DO (%L)", "98.5", "oxygen_saturation_percent", 98.5),
        ("Dissolved O₂ saturation(%)", "98.5", "oxygen_saturation_percent", 98.5),
        ("pH_units", "7.5", "ph", 7.5),
    ],
)
def test_columns_of_other_makers_and_languages_are_known(
    path: Path, name: str, cell: str, key: str, value: float
) -> None:
    track = read(path, f"time,{name}", "2024-07-18T09:15:00Z", cell)
    assert track.values[key] == pytest.approx(np.full(20, value))


def test_of_two_columns_of_one_name_the_second_is_reported_and_can_be_named(path: Path) -> None:
    header, cells = "time,Temp (C),Temp (C)", ("2024-07-18T09:15:00Z", "25", "18.5")
    track = read(path, header, *cells)
    assert "Temp (C) #2" in track.unused
    assert [note for note in track.notes if note.startswith("2 columns are called 'Temp (C)'")]
    second = read_track(path, {"temperature_degc": "Temp (C) #2"})
    assert second.values["temperature_degc"][0] == 18.5


def test_an_ambiguous_nitrate_is_reported(path: Path) -> None:
    def told(name: str) -> bool:
        track = read(path, f"time,{name}", "2024-07-18T09:15:00Z", "2.1")
        return any("4.43 times" in note for note in track.notes)

    assert told("Nitrate (mg/L)")
    assert told("NO3 mg/L")
    assert not told("NO3-N mg/L")


def test_a_sounder_that_speaks_dbt_alone_gives_the_depth(tmp_path: Path) -> None:
    def sentence(body: str) -> str:
        check = 0
        for letter in body:
            check ^= ord(letter)
        return f"${body}*{check:02X}"

    fix = sentence("GPRMC,091500.00,A,4630.0000,N,00800.0000,E,2.0,0.0,180724,,")
    log = tmp_path / "boat.nmea"
    log.write_text("\n".join([sentence("SDDBT,16.4,f,5.0,M,2.7,F"), fix, fix]) + "\n")
    table = read_nmea(log)
    assert [row[4] for row in table.rows] == ["5.0", ""]


@pytest.mark.parametrize("name", ["Date", "Fecha y hora", "Mesure le"])
def test_a_date_with_a_time_of_day_is_the_time_whatever_its_column_is_called(
    tmp_path: Path, name: str
) -> None:
    """As a spreadsheet has it; a date that never changes is when something else was."""
    path = tmp_path / "track.csv"
    rows = [
        f"02/01/2024 08:00;18/07/2024 09:{15 + k};{45 + k / 1e4:.7f};5,000000{k};19,{k}"
        for k in range(6)
    ]
    path.write_text("\r\n".join([f"Calibrated;{name};Lat;Lon;Temp °C", *rows]), "utf-8-sig")
    track = read_track(path)
    assert track.times[0] == MOMENT
    assert track.times[-1] == MOMENT + 300
    assert track.columns["time"] == name
