"""Loggers' files of all kinds: contradictions are refused, conversions are reported."""

import json
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import CHINA, TRACKS, needs_tracks

from grebe.cli.main import grebe
from grebe.core.errors import InputError, TrackError
from grebe.core.samples import Flag
from grebe.io.readers.clock import read_times
from grebe.io.readers.profile import read_profile
from grebe.io.readers.track import read_readings, read_track
from grebe.io.readers.zones import zone_of
from grebe.workflow.tracks import import_track


def table(tmp_path, header, cells, n=30, name="t.csv", before="", encoding="utf-8", mark=","):
    rows = [
        mark.join([str(1000 + i), str(50 + i * 1e-5), str(3 + i * 1e-5), *map(str, cells)])
        for i in range(n)
    ]
    path = tmp_path / name
    path.write_text(
        before + "\n".join([mark.join(["time", "lat", "lon", *header]), *rows]), encoding
    )
    return path


def test_names_that_do_not_fit_are_refused(tmp_path):
    sibling = table(tmp_path, ["odo %", "x"], [1, 2], name="other.csv")
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(f"{1000 + i},{50 + i * 1e-5},3,20" for i in range(9)))
    with pytest.raises(TrackError, match=r"rows have 4 columns, and .*other.csv names 5"):
        read_track(bare, header_from=sibling)


@pytest.mark.parametrize(
    ("header", "cell", "key", "value"),
    [
        ("DO (%)", 95, "oxygen_saturation_percent", 95),
        ("SpCond mS/cm", 0.108, "specific_conductance_uscm", 108),
        ("Temperature (F)", 68, "temperature_degc", 20),
        ("Specific Conductivity (mS/cm) (790478)", 0.5, "specific_conductance_uscm", 500),
        ("Turbidity FNU", 3, "turbidity_ntu", 3),
        ("Chlorophyll-a Concentration (µg/L) (652536)", 3, "chlorophyll_ugl", 3),
        ("RDO Concentration (mg/L) (543925)", 8, "dissolved_oxygen_mgl", 8),
        ("Temp, °C (LGR S/N: 1, SEN S/N: 1)", 20, "temperature_degc", 20),
    ],
)
def test_units_in_headers_are_believed(tmp_path, header, cell, key, value):
    quoted = f'"{header}"' if "," in header else header
    track = read_track(table(tmp_path, [quoted, "junk"], [cell, 1]))
    assert set(track.values) == {key}
    assert track.values[key] == pytest.approx(value)
    assert track.unused == ("junk",)
    assert any("converted from" in note for note in track.notes) == (cell != value)


def test_a_voltage_is_no_ph(tmp_path):
    assert not read_track(table(tmp_path, ["pH mV"], [-20])).values


def test_a_column_of_another_kind_is_refused_and_oxygen_is_reckoned(tmp_path):
    path = table(tmp_path, ["DO (%)", "Temp (C)"], [100, 20])
    track = read_track(path, {"dissolved_oxygen_mgl": "DO (%)"})
    assert track.values["dissolved_oxygen_mgl"] == pytest.approx(9.092, abs=1e-3)
    with pytest.raises(TrackError, match=r"'Temp \(C\)' is in C, and ph in"):
        read_track(path, {"ph": "Temp (C)"})
    with pytest.raises(TrackError, match="only with the temperature"):
        read_track(table(tmp_path, ["DO (%)"], [9]), {"dissolved_oxygen_mgl": "DO (%)"})


def test_lines_before_the_header_and_utf_16_and_semicolons(tmp_path):
    before = "KorEXO Measurement Data File Export\nUser;x\nMEAN VALUE:;;;1;2\n\n"
    path = table(
        tmp_path, ["Temp °C", "ODO mg/L"], [20, 9], before=before, encoding="utf-16", mark=";"
    )
    track = read_track(path)
    assert track.values["dissolved_oxygen_mgl"] == pytest.approx(9)
    assert "3 lines before the header" in " ".join(track.notes)


def test_a_line_of_units_below_the_header(tmp_path):
    path = tmp_path / "minidot.txt"
    rows = "\n".join(
        f"{1.6e9 + i}, 2020-09-13 12:26:40, 3.5, 68.0, 9.0, 99, 0.98" for i in range(9)
    )
    path.write_text(
        "7392-875323\nOS REV: 1.0\n\n"
        "Unix Timestamp, UTC_Date_&_Time, Battery, Temperature, Dissolved Oxygen, "
        "Dissolved Oxygen Saturation, Q\n"
        "(Second), (none), (Volt), (deg F), (mg/l), (%), (none)\n" + rows
    )
    read = read_readings(path, placed=False)
    assert read.values["temperature_degc"] == pytest.approx(20)
    assert read.values["oxygen_saturation_percent"] == pytest.approx(99)
    assert read.times[0] == 1.6e9


def test_positions_in_whole_numbers(tmp_path):
    rows = [f"{1000 + i},{500000000 + 100 * i},{30000000 + 100 * i},7" for i in range(9)]
    path = tmp_path / "e7.csv"
    path.write_text("\n".join(["time,lat,lon,ph", *rows]))
    track = read_track(path)
    assert track.lonlat[0] == pytest.approx([3, 50])
    assert any("1e-7" in note for note in track.notes)


def test_a_date_and_a_time_and_their_order(tmp_path):
    cells = ["06/28/2019 10:00:00", "06/28/2019 10:00:01"]
    seconds, notes = read_times(cells)
    assert seconds[0] == 1561716000
    assert notes == ["times without a zone: taken as UTC"]
    hobo, _ = read_times(["06/28/19 10:00:00 AM"], "Date Time, GMT-04:00")
    assert hobo[0] - seconds[0] == 4 * 3600
    with pytest.raises(InputError, match="may be day and month"):
        read_times(["06/07/2019 10:00:00"])
    days, _ = read_times(["06/07/2019 10:00:00"], "Date (DD/MM/YYYY)")
    assert days[0] == 1562407200


def test_the_hour_that_occurs_twice_is_resolved():
    paris = zone_of("Europe/Paris")
    cells = ["2025-10-26 02:30:00", "2025-10-26 02:59:59", "2025-10-26 02:00:00"]
    seconds, notes = read_times(cells, zone=paris)
    assert list(np.diff(seconds)) == [1799, 1]
    assert "3 times in the hour that Europe/Paris had twice" in notes[0]
    _, notes = read_times(["2025-03-30 02:30:00", "2025-03-30 03:30:00"], zone=paris)
    assert "1 time in the hour that Europe/Paris skipped" in notes[0]
    with pytest.raises(InputError, match="no time zone 'Mars'"):
        zone_of("Mars")


@needs_tracks
def test_a_profile_names_the_columns_of_a_file_without_a_header(tmp_path):
    path = next(TRACKS.glob("Sunapee*1ms.csv"))
    by_name = read_track(path, profile=read_profile("catabot"))
    assert by_name.columns == read_track(path, header_from=CHINA).columns
    own = tmp_path / "own.toml"
    own.write_text('names = ["a"]\nwhat = 1')
    with pytest.raises(InputError, match="holds 'what'"):
        read_profile(str(own))
    with pytest.raises(InputError, match="no profile 'x'"):
        read_profile("x")


@pytest.mark.parametrize("ahead", [0, -97, 3671])
def test_a_sonde_is_joined_by_the_clock_and_its_offset_is_reported(tmp_path, ahead):
    rng = np.random.default_rng(3)
    t = np.arange(900)
    warm = 20 + np.cumsum(rng.normal(0, 0.02, 900))
    place = 50 + t * 9e-6
    boat = tmp_path / "boat.csv"
    boat.write_text(
        "time,lat,lon,temp (C)\n"
        + "\n".join(f"{1.6e9 + i},{place[i]},{3 + (i % 300) * 1e-6},{warm[i]}" for i in t)
    )
    sonde = tmp_path / "sonde.csv"
    sonde.write_text(
        "time,Temp (F),pH\n"
        + "\n".join(f"{1.6e9 + i + ahead},{1.8 * warm[i] + 32},{7 + i * 1e-3}" for i in t[100:800])
    )
    out = tmp_path / "out.gpkg"
    args = ["import", str(boat), "--with", str(sonde), "-o", str(out), "--json"]
    done = CliRunner().invoke(grebe, args)
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["samples"] == 700
    assert f"{ahead:+d} s ahead, estimated from temperature_degc" in done.stderr


def test_a_sonde_of_another_day_is_refused(tmp_path):
    boat = table(tmp_path, ["ph"], [7], name="boat.csv")
    sonde = tmp_path / "sonde.csv"
    sonde.write_text("time,Temp (C)\n" + "\n".join(f"{90000 + i},20" for i in range(9)))
    with pytest.raises(TrackError, match="none of its readings falls within") as told:
        import_track(boat, tmp_path / "o.gpkg", sondes=[sonde])
    assert told.value.settings == ("zone", "clock_offset_s")


def at(path, seconds=0):
    """Return the time of a row, from the file's own clock converted to UTC."""
    return datetime.fromtimestamp(float(read_track(path).times[seconds]), UTC).isoformat()


def track_of(folder, header, cells, count=40, name="t.csv"):
    """Write a straight track in which row k has `cells(k)` after its position."""
    lines = [header]
    lines += [f"{cells(k)},{50 + k * 2e-5:.6f},3.0,{20 + k * 0.01:.3f}" for k in range(count)]
    path = folder / name
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("header", "cell", "expected"),
    [
        ("time", "{s}", "2024-07-03T09:15:00+00:00"),
        ("time", "{s}000", "2024-07-03T09:15:00+00:00"),
        ("time", "{s}000000", "2024-07-03T09:15:00+00:00"),
        ("time", "{s}000000000", "2024-07-03T09:15:00+00:00"),
        ("Time (UTC+2)", "2024-07-03 11:{m}", "2024-07-03T09:15:00+00:00"),
        ("time", "2024-07-03 09:{m} UTC", "2024-07-03T09:15:00+00:00"),
        ('Date,"Time, GMT-04:00"', "2024-07-03,05:{m}", "2024-07-03T09:15:00+00:00"),
        ("Date,Time,UTC Time", "2024-07-03,11:{m},2024-07-03 09:{m}", "2024-07-03T09:15:00+00:00"),
        ("TZ,Date,Time", "-05:00,2024-07-03,04:{m}", "2024-07-03T09:15:00+00:00"),
        ("Date,Time,timestamp", "2024-07-03,11:{m},{s}", "2024-07-03T09:15:00+00:00"),
    ],
)
def test_times_are_those_that_the_file_states(tmp_path, header, cell, expected):
    """This holds for any unit since 1970, and for any column that names the zone."""

    def cells(k):
        return cell.format(s=1719998100 + k, m=f"15:{k:02}")

    path = track_of(tmp_path, f"{header},lat,lon,temp", cells)
    assert at(path) == expected
    assert np.diff(read_track(path).times) == pytest.approx(1.0, abs=1e-3)


def test_a_zone_in_the_header_counts_more_than_one_that_is_given(tmp_path):
    path = track_of(
        tmp_path, '"Date Time, GMT-04:00",lat,lon,temp', lambda k: f"2024-07-03 05:15:{k:02}"
    )
    read = read_track(path, zone=ZoneInfo("Europe/Paris"))
    assert datetime.fromtimestamp(read.times[0], UTC).hour == 9


def test_a_spreadsheet_s_days_are_times(tmp_path):
    day = 45476 + (9 * 3600 + 15 * 60) / 86400
    path = track_of(tmp_path, "time,lat,lon,temp", lambda k: f"{day + k / 86400:.9f}")
    assert at(path).startswith("2024-07-03T09:1")
    assert any("spreadsheet" in note for note in read_track(path).notes)


@pytest.mark.parametrize("wrong", ["0", "315532800", "1e19", "4900000000"])
def test_one_clock_that_was_not_set_costs_one_row(tmp_path, wrong):
    """A logger writes 1970 or 1980 until it has a fix, which used to spoil the complete survey."""
    path = track_of(tmp_path, "time,lat,lon,temp", lambda k: wrong if k == 0 else 1719998100 + k)
    track = read_track(path)
    assert len(track.times) == 39
    assert track.times.min() > 1.7e9


def test_commas_between_thousands_are_none_before_decimals(tmp_path):
    path = tmp_path / "t.csv"
    rows = [
        f'{1719998100 + k},{50 + k * 2e-5:.6f},3.000001,"12,{345 + k}",{1.5 + k / 100}'
        for k in range(40)
    ]
    path.write_text("\n".join(["time,lat,lon,SpCond (µS/cm),turbidity (NTU)", *rows]))
    values = read_track(path).values["specific_conductance_uscm"]
    assert values == pytest.approx(12345 + np.arange(40))


@pytest.mark.parametrize(
    ("header", "key", "factor"),
    [
        ("Specific Conductance (mS/cm @25°C)", "specific_conductance_uscm", 1000),
        ("Specific Conductance (mS)", "specific_conductance_uscm", 1000),
        ("Specific Conductivity (µS/cm)", "specific_conductance_uscm", 1),
        ("Water Temperature (°C)", "temperature_degc", 1),
    ],
)
def test_a_unit_may_say_at_which_temperature_it_holds(tmp_path, header, key, factor):
    path = track_of(tmp_path, f"time,lat,lon,{header}", lambda k: 1719998100 + k)
    assert read_track(path).values[key][0] == pytest.approx(20.0 * factor)


def test_what_speaks_of_a_value_is_not_the_value(tmp_path):
    path = tmp_path / "t.csv"
    rows = [f"{1719998100 + k},{50 + k * 2e-5:.6f},3.0,0.01,{20 + k},68" for k in range(40)]
    names = "time,lat,lon,Water Temp StdDev,Water Temperature (°C),WaterTempF"
    path.write_text("\n".join([names, *rows]))
    track = read_track(path)
    assert track.columns["temperature_degc"] == "Water Temperature (°C)"
    assert set(track.unused) == {"Water Temp StdDev", "WaterTempF"}


@pytest.mark.parametrize("order", ["reversed", "shuffled", "twice"])
def test_rows_out_of_order_are_put_in_order(tmp_path, order):
    path = track_of(tmp_path, "time,lat,lon,temp", lambda k: 1719998100 + k)
    head, *rows = path.read_text().splitlines()
    known = read_track(path)
    if order == "reversed":
        rows = rows[::-1]
    elif order == "shuffled":
        rows = [rows[i] for i in np.random.default_rng(0).permutation(len(rows))]
    else:
        rows = rows + rows
    path.write_text("\n".join([head, *rows]))
    track = read_track(path)
    assert np.all(np.diff(track.times) >= 0)
    assert set(track.times) == set(known.times)
    assert track.values["temperature_degc"][-1] == known.values["temperature_degc"][-1]
    assert any("order" in note for note in track.notes)


def test_sides_of_the_earth_are_believed(tmp_path):
    path = tmp_path / "t.csv"
    rows = [f"{1719998100 + k},{50 + k * 2e-5:.6f},S,3.0,W,20" for k in range(40)]
    path.write_text("\n".join(["time,lat,N/S,lon,E/W,temp", *rows]))
    assert np.all(read_track(path).lonlat < 0)
    rows = [f"{1719998100 + k},{50 + k * 2e-5:.6f},73.1,20" for k in range(40)]
    path.write_text("\n".join(["time,Latitude (N),Longitude (W),temp", *rows]))
    assert np.all(read_track(path).lonlat[:, 0] == -73.1)
    path.write_text(
        "\n".join(["time,lat,lon,temp", *(r.replace(",73.1,", ",286.9,") for r in rows)])
    )
    assert read_track(path).lonlat[:, 0] == pytest.approx(-73.1)


def test_metres_of_a_projection_are_no_degrees(tmp_path):
    path = tmp_path / "t.csv"
    rows = [f"{1719998100 + k},{5806000 + 2 * k},367000.5,20" for k in range(40)]
    path.write_text("\n".join(["time,lat,lon,temp", *rows]))
    with pytest.raises(TrackError, match="projected"):
        read_track(path)


def test_a_number_that_stands_for_none_takes_no_neighbour_with_it(tmp_path):
    path = track_of(tmp_path, "time,lat,lon,temp", lambda k: 1719998100 + k, count=200)
    head, *rows = path.read_text().splitlines()
    for k in range(20, 200, 20):
        rows[k] = rows[k].rsplit(",", 1)[0] + ",-9999"
    rows = [row.replace(",3.0,", f",{3.0 + (k % 7) * 1e-5:.6f},") for k, row in enumerate(rows)]
    path.write_text("\n".join([head, *rows]))
    done = import_track(path, tmp_path / "t.gpkg")
    flags = done.quality.flags["temperature_degc"]
    assert (flags == Flag.GOOD).sum() == 200 - 9
    assert (flags == Flag.FAIL).sum() == 9


@pytest.mark.parametrize(
    ("header", "row", "lon", "lat"),
    [
        ("time,lat,lon,Direction,temp", "{t},{lat},3.0,N,20", 3.0, 50.0),
        ("time,lat,lon,Wind direction,temp", "{t},{lat},3.0,S,20", 3.0, 50.0),
        ("time,Latitude,Longitude (W),temp", "{t},{lat},-3.0,20", -3.0, 50.0),
        ("time,lat,lon_w,temp", "{t},{lat},-3.0,20", -3.0, 50.0),
        ("time,lat,lat_dir,lon,lon_dir,temp", "{t},-{lat},S,3.0,W,20", -3.0, -50.0),
        ("time,lat,Longitude (W),lon_dir,temp", "{t},{lat},3.0,W,20", -3.0, 50.0),
    ],
)
def test_a_side_is_stated_once_and_a_direction_is_none(tmp_path, header, row, lon, lat):
    path = tmp_path / "t.csv"
    rows = [row.format(t=1719998100 + k, lat=f"{50 + k * 1e-5:.6f}") for k in range(40)]
    path.write_text("\n".join([header, *rows]))
    given = {"lon": "lon_w"} if "lon_w" in header else {}
    track = read_track(path, given)
    assert len(track.lonlat) == 40
    assert np.abs(track.lonlat - (lon, lat)).max() < 1e-3


@pytest.mark.parametrize("first", [36000.25, 45000.0])
def test_seconds_of_the_day_are_no_spreadsheet_s_days(tmp_path, first):
    path = track_of(tmp_path, "time,lat,lon,temp", lambda k: f"{first + 0.5 * k:.2f}")
    assert read_track(path).times[0] == first


def test_a_file_of_several_years_keeps_them(tmp_path):
    path = track_of(
        tmp_path, "time,lat,lon,temp", lambda k: 1655000000 + k if k < 12 else 1719998100 + k
    )
    assert len(read_track(path).times) == 40


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Date;Time;Temp;Turbidity (NTU);Battery\n" + "2024-07-03;09:15:00;20,125;0,450;12.4\n" * 5,
         {"temperature_degc": 20.125, "turbidity_ntu": 0.45}),
        ('time,temp,pH,note\n' + '1719998100,20.5,7.1,"a; b; c; d"\n' * 5,
         {"temperature_degc": 20.5, "ph": 7.1}),
    ],
    ids=["three decimals", "marks in quotes"],
)  # fmt: skip
def test_a_comma_is_what_the_file_uses_it_for(tmp_path, text, expected):
    path = tmp_path / "s.csv"
    path.write_text(text)
    values = read_readings(path, placed=False).values
    assert {key: column[0] for key, column in values.items()} == pytest.approx(expected)


@pytest.mark.parametrize("zone", ["-99", "+31"])
def test_a_zone_that_is_none_is_not_taken_for_one(tmp_path, zone):
    path = track_of(
        tmp_path, "Zone,Date,Time,lat,lon,temp", lambda k: f"{zone},2024-07-03,09:15:{k:02}"
    )
    assert at(path) == "2024-07-03T09:15:00+00:00"


def test_columns_of_place_and_time_may_be_raw(tmp_path):
    path = track_of(
        tmp_path, "timestamp_raw,latitude_raw,longitude_raw,temp", lambda k: 1719998100 + k
    )
    assert len(read_track(path).times) == 40


def test_a_stamp_of_digits_is_no_count_of_seconds(tmp_path):
    path = track_of(
        tmp_path, "timestamp,Date,Time,lat,lon,temp",
        lambda k: f"202407030915{k:02},2024-07-03,09:15:{k:02}",
    )  # fmt: skip
    assert at(path) == "2024-07-03T09:15:00+00:00"


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        ("45°30.5'N", "71°12.06'W"),
        ("N 45 30 30", "W 71 12 3.6"),
        ("45:30:30 N", "71:12:03.6 W"),
        ("45° 30′ 30″", "-71° 12′ 3.6″"),
        ("45.508333 N", "71.201 W"),
    ],
)
def test_degrees_with_minutes_and_sides_are_read(tmp_path, lat, lon):
    path = tmp_path / "t.csv"
    rows = "\n".join(f'{1.6e9 + k},"{lat}","{lon}",7.{k}'.replace("″", '""') for k in range(9))
    path.write_text("time,lat,lon,ph\n" + rows)
    read = read_track(path)
    assert read.lonlat[0] == pytest.approx([-71.201, 45.508333], abs=1e-6)
    assert any("degrees with minutes or sides" in note for note in read.notes)


@pytest.mark.parametrize(
    "header",
    ["Latitude,N/S,Longitude,E/W", "Latitude (DDMM.MMMM),Longitude (DDDMM.MMMM)"],
)
def test_receivers_numbers_of_degrees_and_minutes_are_read(tmp_path, header):
    sides = "N/S" in header
    path = tmp_path / "t.csv"
    place = "4530.50{k},N,00112.06,W" if sides else "4530.50{k},-00112.06"
    path.write_text(
        f"time,{header},ph\n"
        + "\n".join(f"{1.6e9 + k},{place.format(k=k)},7.{k}" for k in range(9))
    )
    read = read_track(path)
    assert read.lonlat[0] == pytest.approx([-1.201, 45.508333], abs=1e-6)
