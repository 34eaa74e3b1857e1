"""Tables as people bring them: repeated headers, separate units, texts among numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from grebe.core.errors import InputError, TrackError
from grebe.io.readers.text import read_any_text, read_text
from grebe.io.readers.track import RawTrack, read_track

HEADER = "time,latitude,longitude,Temp,pH"
TIMES = range(1_600_000_000, 1_600_000_020)


def row(k: int, *values: object) -> str:
    """Return row k of a boat that goes north."""
    return ",".join(map(str, (TIMES[k], 44.4 + 1e-5 * k, -69.6, *values)))


def read(path: Path, *lines: str) -> RawTrack:
    """Read a track of some lines."""
    path.write_text("\n".join(lines) + "\n")
    return read_track(path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "track.csv"


def test_a_header_that_comes_again_is_no_row(path: Path) -> None:
    rows = [row(k, 20 + k, 7) for k in range(20)]
    track = read(path, HEADER, *rows[:10], HEADER, *rows[10:])
    assert track.values["temperature_degc"].tolist() == [20.0 + k for k in range(20)]
    assert "1 header among the rows: not used" in track.notes


def test_columns_that_changed_places_are_put_back(path: Path) -> None:
    first = [row(k, 20, 7) for k in range(10)]
    after = [row(k, 7, 20) for k in range(10, 20)]
    track = read(path, HEADER, *first, "time,latitude,longitude,pH,Temp", *after)
    assert track.values["temperature_degc"].tolist() == [20.0] * 20
    assert track.values["ph"].tolist() == [7.0] * 20


def test_a_header_of_other_columns_is_refused(path: Path) -> None:
    rows = [row(k, 20, 7) for k in range(20)]
    with pytest.raises(TrackError, match="another header, with Turbidity; give a file for each"):
        read(path, HEADER, *rows[:10], "time,latitude,longitude,Turbidity,pH", *rows[10:])


@pytest.mark.parametrize("name", ["TempUnit", "Temp_units", "Unit"])
def test_a_unit_in_a_column_of_its_own_counts(path: Path, name: str) -> None:
    header = f"time,latitude,longitude,Temp,{name}"
    track = read(path, header, *(row(k, 68, "F") for k in range(20)))
    assert track.values["temperature_degc"] == pytest.approx(np.full(20, 20.0))
    assert name not in track.unused


def test_two_units_in_one_column_are_refused(path: Path) -> None:
    rows = [row(k, 20, "CF"[k % 2]) for k in range(20)]
    with pytest.raises(TrackError, match="'TempUnit' names the units C, F of one quantity"):
        read(path, "time,latitude,longitude,Temp,TempUnit", *rows)


def test_cells_that_are_not_numbers_are_reported(path: Path) -> None:
    rows = [row(k, "19.5 C" if k % 2 else 19.5, "" if k % 3 else "NaN") for k in range(20)]
    track = read(path, HEADER, *rows)
    assert "Temp: 10 of 20 cells are not numbers ('19.5 C'): left out" in track.notes
    assert not any(note.startswith("pH") for note in track.notes)


def test_one_value_is_reported_in_the_singular(path: Path) -> None:
    rows = [row(k, "19.5 C" if k == 9 else 19.5, 7) for k in range(20)]
    track = read(path, "a logger", HEADER, *rows[:10], HEADER, *rows[10:])
    assert track.notes == (
        "1 line before the header: not used",
        "1 header among the rows: not used",
        "Temp: 1 of 20 cells is not a number ('19.5 C'): left out",
    )


def test_of_air_and_water_the_water_s_temperature_is_taken(path: Path) -> None:
    header = "time,latitude,longitude,Temperature (°C),Water Temperature (°C)"
    track = read(path, header, *(row(k, 28, 20) for k in range(20)))
    assert track.values["temperature_degc"].tolist() == [20.0] * 20
    assert track.unused == ("Temperature (°C)",)


def test_a_depth_alone_is_the_water_s(path: Path) -> None:
    track = read(path, "time,latitude,longitude,Depth (ft)", *(row(k, 10) for k in range(20)))
    assert track.values["water_depth_m"] == pytest.approx(np.full(20, 3.048))
    beside = read(path, f"{HEADER},Depth (m)", *(row(k, 20, 7, 0.5) for k in range(20)))
    assert "sonde_depth_m" in beside.values


def test_a_twelve_hour_clock_and_a_pause_are_reported(path: Path) -> None:
    hours = [12] * 10 + [1] * 10
    lines = [
        f"2020-09-15 {hour:02d}:{(50 + k) % 60:02d}:00,{44.4 + 1e-5 * k},-69.6,20,7"
        for k, hour in enumerate(hours)
    ]
    track = read(path, HEADER, *lines)
    assert any("row 11: a clock of twelve hours without AM and PM" in one for one in track.notes)
    rows = [row(k, 20, 7) for k in range(20)]
    later = [line.replace("16000000", "16001260") for line in rows[10:]]
    notes = read(path, HEADER, *rows[:10], *later).notes
    assert any(one.startswith("a pause of 35 hours after row 10:") for one in notes)


def test_a_date_with_am_and_pm_has_the_month_first_in_america(path: Path) -> None:
    lines = [f"11/01/20 01:{k:02d}:00 AM,{44.4 + 1e-5 * k},-69.6,20,7" for k in range(20)]
    header = HEADER.replace("time", '"Date Time, GMT-04:00"')
    track = read(path, header, *lines)
    assert track.times is not None
    assert np.datetime64(int(track.times[0]), "s") == np.datetime64("2020-11-01T05:00:00")
    with pytest.raises(InputError, match="may be day and month or month and day"):
        read(path, HEADER, *lines)


def test_a_record_across_midnight_distinguishes_day_from_month(path: Path) -> None:
    def lines(first: str, second: str) -> list[str]:
        clocks = [f"{first} 11:{50 + k}:00 PM" for k in range(10)]
        clocks += [f"{second} 12:{k:02d}:00 AM" for k in range(10)]
        return [f"{clock},{44.4 + 1e-5 * k},-69.6,20,7" for k, clock in enumerate(clocks)]

    for dates, begun in (
        (("03/07/20", "04/07/20"), "2020-07-03T23:50:00"),
        (("07/03/20", "07/04/20"), "2020-07-03T23:50:00"),
    ):
        track = read(path, HEADER, *lines(*dates))
        assert track.times is not None
        assert np.datetime64(int(track.times[0]), "s") == np.datetime64(begun)
        assert np.ptp(track.times) == 19 * 60
        assert any("continues past midnight" in note for note in track.notes)
    # These are trips on the first of each month, or on consecutive days: nobody can know.
    monthly = [f"0{k}/0{m}/20 10:00:00 AM,44.4,-69.6,20,7" for m in (3, 4, 5, 6) for k in (1,)]
    with pytest.raises(InputError, match="may be day and month"):
        read(path, HEADER, *monthly)


def test_appended_files_with_marks_and_trailing_commas_are_one(path: Path) -> None:
    rows = [row(k, 20 + k, 7) for k in range(20)]
    for first, again in (
        (f"{HEADER},", HEADER),
        (HEADER, f"{HEADER},"),
        (HEADER, f"\ufeff{HEADER}"),
    ):
        track = read(path, first, *rows[:10], again, *rows[10:])
        assert track.values["temperature_degc"].tolist() == [20.0 + k for k in range(20)]
        assert not any("another order" in note for note in track.notes)


def test_a_later_header_of_more_columns_is_refused_and_loses_no_row(path: Path) -> None:
    rows = [row(k, 20) for k in range(10)]
    more = [row(k, 20, 7) for k in range(10, 20)]
    with pytest.raises(TrackError, match="another header, with pH"):
        read(path, "time,latitude,longitude,Temp", *rows, HEADER, *more)


def test_other_units_below_a_later_header_are_refused(path: Path) -> None:
    header = "time,latitude,longitude,Temp"
    rows = [row(k, 68) for k in range(20)]
    units = ("s,deg,deg,degF", "s,deg,deg,degC")
    with pytest.raises(TrackError, match=r"degF become .*degC further down"):
        read(path, header, units[0], *rows[:10], header, units[1], *rows[10:])
    track = read(path, header, units[0], *rows[:10], header, units[0], *rows[10:])
    assert track.values["temperature_degc"] == pytest.approx(np.full(20, 20.0))


def test_a_device_s_letter_is_no_unit(path: Path) -> None:
    header = "Site,Unit,time,latitude,longitude,Temp (C),Air Temp,Air Temp Unit"
    lines = [f"A,{'CF'[k % 2]},{row(k, 20)},68,{'FC'[k % 2]}" for k in range(20)]
    assert read(path, header, *lines).values["temperature_degc"].tolist() == [20.0] * 20


def test_one_broken_byte_makes_no_other_letters(tmp_path: Path) -> None:
    broken = tmp_path / "broken.csv"
    broken.write_bytes("Temp (°F)\n".encode() + b"caf\xe9\n")
    with pytest.raises(InputError, match="is not UTF-8 text"):
        read_any_text(broken)


def test_swapped_coordinates_of_some_rows_are_recognised(path: Path) -> None:
    rows = [row(k, 20, 7) for k in range(20)]
    rows[5] = f"{TIMES[5]},-69.6,44.40005,20,7"
    track = read(path, HEADER, *rows)
    assert len(track.lonlat) == 19
    assert any("latitude and longitude look swapped there" in note for note in track.notes)


def test_a_spreadsheet_of_windows_is_read_and_a_picture_is_not(tmp_path: Path) -> None:
    sheet, picture = tmp_path / "sheet.csv", tmp_path / "picture.csv"
    sheet.write_bytes("Temp °C;SpCond µS/cm\n".encode("cp1252"))
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x01")
    text, notes = read_any_text(sheet)
    assert text == "Temp °C;SpCond µS/cm\n"
    assert "Windows-1252" in notes[0]
    for reader, path in ((read_text, sheet), (read_any_text, picture)):
        with pytest.raises(Exception, match="is not UTF-8 text"):
            reader(path)
