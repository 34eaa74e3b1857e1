"""Sea-Bird's .cnv, as SBE Data Processing writes it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.core.errors import TrackError
from grebe.io.readers.track import read_readings, read_track
from grebe.io.readers.zones import zone_of
from grebe.workflow.tracks import import_track

START = datetime(2023, 6, 21, 14, 5, 32, tzinfo=UTC)
INSTRUMENT = "Jun 21 2023 14:05:32 [Instrument's time stamp, header]"
NMEA = "Jun 21 2023 14:05:32 [NMEA time, header]"
BAD = "-9.990e-29"
SENSORS = (
    "tv290C: Temperature [ITS-90, deg C]",
    "c0S/m: Conductivity [S/m]",
    "sbeox0ML/L: Oxygen, SBE 43 [ml/l]",
    "t190C: Temperature, 2 [ITS-90, deg C]",
)


def sensed(k: int) -> tuple[float, ...]:
    return 20 + 0.01 * k, 0.05, 6.0, 21.0


def cnv(
    path: Path,
    names: tuple[str, ...] = SENSORS,
    row: Callable[[int], tuple[object, ...]] = sensed,
    *,
    start: str | None = INSTRUMENT,
    count: int = 60,
    told: int | None = None,
    more: tuple[str, ...] = (),
) -> Path:
    """Return a file of `count` scans, with values in columns of eleven characters."""
    header = [
        "* Sea-Bird SBE 19plus V 2 Data File:",
        r"* FileName = C:\data\lake.hex",
        "* Temperature SN = 6543",
        f"# nquan = {len(names)}",
        f"# nvalues = {count if told is None else told}",
        "# units = specified",
        *(f"# name {k} = {name}" for k, name in enumerate(names)),
        "# span 0 =          0,          1",
        "# interval = seconds: 1",
        *([] if start is None else [f"# start_time = {start}"]),
        f"# bad_flag = {BAD}",
        *more,
        "# file_type = ascii",
        "*END*",
    ]
    rows = [
        "".join(f"{v:>11}" if isinstance(v, str) else f"{v:11.5f}" for v in row(k))
        for k in range(count)
    ]
    path.write_text("\r\n".join([*header, *rows]) + "\r\n")
    return path


def test_a_track_has_its_units_from_the_names(tmp_path: Path) -> None:
    names = ("timeS: Time, Elapsed [seconds]", *SENSORS[:3], "depSM: Depth [fresh water, m]",
             "latitude: Latitude [deg]", "longitude: Longitude [deg]", "flag: flag")  # fmt: skip
    path = cnv(
        tmp_path / "lake.cnv",
        names,
        lambda k: (2.0 * k, *sensed(k)[:3], 0.5, 44.4 + 2e-5 * k, -69.6, "0.0000e+00"),
        start=NMEA,
    )
    track = read_track(path)
    assert track.times is not None
    assert track.times == pytest.approx(START.timestamp() + 2.0 * np.arange(60))
    assert track.lonlat[0] == pytest.approx([-69.6, 44.4])
    first = {key: column[0] for key, column in track.values.items()}
    assert first == pytest.approx(
        {
            "temperature_degc": 20.0,
            "conductivity_uscm": 500.0,
            "dissolved_oxygen_mgl": 6.0 * 1.42903,
            "sonde_depth_m": 0.5,
        }
    )
    assert track.unused == ("flag",)


@pytest.mark.parametrize(
    ("name", "value", "start"),
    [
        ("timeS: Time, Elapsed [seconds]", float, NMEA),
        ("timeM: Time, Elapsed [minutes]", lambda k: f"{k / 60:.7f}", NMEA),
        ("timeH: Time, Elapsed [hours]", lambda k: f"{k / 3600:.9f}", NMEA),
        ("timeJ: Julian Days", lambda k: f"{172.587176 + k / 86400:.6f}", NMEA),
        ("timeQ: Time, NMEA [seconds]", lambda k: str(740671532 + k), INSTRUMENT),
        ("timeK: Time, Instrument [seconds]", lambda k: str(740671532 + k), INSTRUMENT),
        ("timeY: Time, System [seconds]", lambda k: str(1687356332 + k), INSTRUMENT),
        ("scan: Scan Count", lambda k: str(k + 1), NMEA),
    ],
)
def test_every_clock_gives_the_same_times(
    tmp_path: Path, name: str, value: Callable[[int], object], start: str
) -> None:
    """They are elapsed, of the year, since 2000 or 1970, or only by the interval between scans."""
    path = cnv(tmp_path / "a.cnv", (name, *SENSORS), lambda k: (value(k), *sensed(k)), start=start)
    read = read_readings(path, placed=False)
    assert read.times is not None
    assert read.times == pytest.approx(START.timestamp() + np.arange(60), abs=0.1)
    local = name.startswith("timeK")
    assert ("times without a zone: taken as UTC" in read.notes) == local
    assert "Temperature, 2 [ITS-90, deg C]" in read.unused


def test_an_instrument_s_own_clock_is_in_the_zone_that_is_given(tmp_path: Path) -> None:
    read = read_readings(cnv(tmp_path / "a.cnv"), zone=zone_of("America/New_York"), placed=False)
    assert read.times is not None
    assert read.times[0] - START.timestamp() == 4 * 3600
    of_nmea = cnv(tmp_path / "b.cnv", start=NMEA)
    told = read_readings(of_nmea, zone=zone_of("America/New_York"), placed=False).times
    assert told is not None
    assert told[0] == START.timestamp()


def test_bad_values_and_bad_scans_are_left_out(tmp_path: Path) -> None:
    def row(k: int) -> tuple[object, ...]:
        warm = BAD if k == 3 else 20.0
        return (BAD if k == 7 else float(k), warm, BAD if k == 5 else "0.0000e+00")

    names = ("timeS: Time, Elapsed [seconds]", SENSORS[0], "flag: flag")
    read = read_readings(cnv(tmp_path / "a.cnv", names, row, count=20), placed=False)
    assert "1 scan marked as bad in the file: left out" in read.notes
    assert read.times is not None
    assert len(read.times) == 19
    assert np.flatnonzero(np.isnan(read.values["temperature_degc"])).tolist() == [3]
    assert np.flatnonzero(np.isnan(read.times)).tolist() == [6]


def test_a_temperature_of_the_scale_of_1968_is_converted(tmp_path: Path) -> None:
    names = ("t068C: Temperature [IPTS-68, deg C]",)
    read = read_readings(cnv(tmp_path / "a.cnv", names, lambda k: (25.006,)), placed=False)
    assert read.values["temperature_degc"] == pytest.approx(np.full(60, 25.0))


@pytest.mark.parametrize(
    "name",
    [
        "oxsatML/L: Oxygen Saturation, Weiss [ml/l]",
        "sbeox0V: Oxygen raw, SBE 43 [V]",
        "wetCDOM: Fluorescence, WET Labs CDOM [mg/m^3]",
        "density00: Density [density, kg/m^3]",
        "prdM: Pressure, Strain Gauge [db]",
    ],
)
def test_columns_of_no_quantity_are_reported_as_unused(tmp_path: Path, name: str) -> None:
    """The oxygen that water could hold is not what it holds, and a voltage is not oxygen."""
    read = read_readings(cnv(tmp_path / "a.cnv", (name,), lambda k: (5.0,)), placed=False)
    assert not read.values
    assert read.unused == (name.partition(": ")[2],)


def test_a_file_that_was_cut_off_is_read_to_its_last_whole_scan(tmp_path: Path) -> None:
    path = cnv(tmp_path / "a.cnv", count=50, told=60)
    path.write_text(path.read_text().rstrip()[:-15])
    read = read_readings(path, placed=False)
    assert len(read.values["temperature_degc"]) == 49
    assert "the header announces 60 rows, but there are 50" in read.notes


def test_a_start_time_of_the_upload_is_reported(tmp_path: Path) -> None:
    path = cnv(tmp_path / "a.cnv", start="Jun 21 2023 14:05:32 [System UpLoad Time]")
    notes = read_readings(path, placed=False).notes
    assert any("start_time is when the instrument was read out" in note for note in notes)


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    path = cnv(tmp_path / "a.cnv")
    text = path.read_text()
    for wrong, why in (
        (text.replace("*END*", ""), r"without a line \*END\*"),
        (text.replace("# file_type = ascii", "# file_type = binary"), "a binary .cnv"),
        (text.replace("# name", "# nome"), "names no column"),
        (text.replace("# name 3 = t190C: Temperature, 2 [ITS-90, deg C]", ""), "names 3 columns"),
    ):
        path.write_text(wrong)
        with pytest.raises(TrackError, match=why):
            read_readings(path, placed=False)


def test_a_sonde_s_cnv_is_joined_to_a_boat_s_track(tmp_path: Path) -> None:
    boat = tmp_path / "boat.csv"
    fixes = [
        f"{START.timestamp() + k:.0f},{44.4 + 2e-5 * k:.6f},{-69.6 + 1e-5 * (k % 7):.6f}"
        for k in range(60)
    ]
    boat.write_text("\n".join(["time,latitude,longitude", *fixes]))
    sonde = cnv(tmp_path / "sonde.cnv", start=NMEA)
    done = import_track(boat, tmp_path / "out.gpkg", sondes=[sonde])
    assert done.samples == 60
    assert done.raw.values["dissolved_oxygen_mgl"] == pytest.approx(np.full(60, 8.57418))


def test_a_track_is_imported_from_the_command_line(tmp_path: Path) -> None:
    names = (*SENSORS, "latitude: Latitude [deg]", "longitude: Longitude [deg]")
    path = cnv(
        tmp_path / "lake.cnv",
        names,
        lambda k: (*sensed(k), 44.4 + 2e-5 * k, -69.6 + 1e-5 * (k % 7)),
        start=NMEA,
    )
    done = CliRunner().invoke(grebe, ["import", str(path), "-o", str(tmp_path / "lake.gpkg")])
    assert done.exit_code == 0, done.output
    assert "2023-06-21 14:05:32 to 2023-06-21 14:06:31 UTC" in done.stdout
