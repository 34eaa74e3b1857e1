"""CSV tracks: columns by name, glitches found and reported."""

import numpy as np
import pytest
from conftest import CHINA, TRACKS, needs_tracks

from grebe.core.errors import InputError, TrackError
from grebe.io.readers.track import read_track
from grebe.workflow.tracks import samples_of_track, survey_of_track

HEADER = "time,Latitude,Longitude,Temp °C,pH"


def rows(n=30):
    return [
        f"{1000 + i},{50.0 + 1e-5 * i:.6f},{3.0 + 1e-5 * i + 1e-7 * i * i:.7f},{20 + 0.01 * i},7.5"
        for i in range(n)
    ]


def write(tmp_path, lines, header=HEADER):
    path = tmp_path / "track.csv"
    path.write_text("\n".join([header, *lines] if header else lines))
    return path


def test_columns_are_found_by_their_names(tmp_path):
    track = read_track(write(tmp_path, rows()))
    assert track.columns["lat"] == "Latitude"
    assert set(track.values) == {"temperature_degc", "ph"}
    assert track.notes == ()


def test_flags_and_zones_are_not_taken_for_values(tmp_path):
    header = "time,time_zone,lat,lon,water_temp,water_temp_qc"
    lines = [f"{1000 + i},0,{50 + 1e-5 * i},{3 + 1e-7 * i * i},20.5,1" for i in range(10)]
    track = read_track(write(tmp_path, lines, header))
    assert track.columns["time"] == "time"
    assert track.columns["temperature_degc"] == "water_temp"


def test_milliseconds_are_read_as_such(tmp_path):
    lines = [f"17600000{row}" for row in rows()]
    lines = [line.replace(",", "0,", 1) for line in lines]
    track = read_track(write(tmp_path, lines))
    assert track.times[0] == pytest.approx(1760000010.0)


def test_columns_can_be_given(tmp_path):
    path = write(tmp_path, rows(), "when,a,b,c,d")
    with pytest.raises(TrackError, match="lat=NAME"):
        read_track(path)
    track = read_track(path, {"lat": "a", "lon": "b", "time": "when", "ph": "d"})
    assert track.lonlat[0] == pytest.approx([3.0, 50.0])
    with pytest.raises(TrackError, match="no column 'zz'"):
        read_track(path, {"lat": "zz"})


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_other_delimiters_are_read(tmp_path, delimiter):
    path = tmp_path / "track.csv"
    path.write_text("\n".join([HEADER, *rows()]).replace(",", delimiter))
    assert len(read_track(path).lonlat) == 30


def test_commas_before_decimals_are_read(tmp_path):
    plain = read_track(write(tmp_path, rows()))
    commas = [row.replace(",", ";").replace(".", ",") for row in rows()]
    read = read_track(write(tmp_path, commas, HEADER.replace(",", ";")))
    assert read.lonlat == pytest.approx(plain.lonlat)
    assert read.values["temperature_degc"] == pytest.approx(plain.values["temperature_degc"])


def test_a_time_column_without_times_is_named(tmp_path):
    lines = [row.replace("10", "at noon ", 1) for row in rows()]
    with pytest.raises(TrackError, match="'time' holds 'at noon 00' and the like"):
        read_track(write(tmp_path, lines), {"time": "time"})


def test_planted_glitches_are_found_and_counted(tmp_path):
    lines = rows()
    lines[5] = "1005,0,0,20,7.5"
    lines[9] = "1009,nan,3.0,20,7.5"
    lines[14] = "1014,50.5,3.0,20,7.5"
    lines[20] = "1020,95.0,3.0,20,7.5"
    lines[25] = "1025"
    track = read_track(write(tmp_path, lines))
    assert len(track.lonlat) == 25
    text = " ".join(track.notes)
    for what in ("2 rows without a position", "1 row at 0, 0", "1 row off", "1 row a jump"):
        assert what in text


def test_a_glitch_in_the_first_row_does_not_condemn_the_rest(tmp_path):
    lines = rows()
    lines[0] = "1000,51.0,4.0,20,7.5"
    assert len(read_track(write(tmp_path, lines)).lonlat) == 29


@pytest.mark.parametrize(
    ("lines", "header", "says"),
    [
        ([], HEADER, "no rows"),
        (rows(2), HEADER, "needs three"),
        ([r.replace(",50.", ",150.") for r in rows()], HEADER, "swapped"),
        (rows(), None, "begins with 1000, .*: values, not the names of columns; add a header row"),
    ],
)
def test_hopeless_files_are_refused(tmp_path, lines, header, says):
    with pytest.raises(TrackError, match=says):
        read_track(write(tmp_path, lines, header))


def test_an_empty_or_missing_or_binary_file_is_refused(tmp_path):
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"lat,lon\n\x81\x00\xff")
    for path, says in ((empty, "empty"), (tmp_path / "none.csv", "no such"), (binary, "UTF-8")):
        with pytest.raises(InputError, match=says):
            read_track(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_track_reads_the_same_in_every_encoding_that_says_what_it_is(tmp_path, encoding, ending):
    plain = read_track(write(tmp_path, rows()))
    path = tmp_path / "other.csv"
    path.write_bytes(ending.join([HEADER, *rows()]).encode(encoding))
    assert np.array_equal(read_track(path).lonlat, plain.lonlat)


def test_utf_16_without_its_mark_says_what_to_do(tmp_path):
    path = tmp_path / "other.csv"
    path.write_bytes("\n".join(["time,lat,lon", *rows()]).encode("utf-16-le"))
    with pytest.raises(InputError, match=r"character 1 is a zero byte.*; save the file as UTF-8"):
        read_track(path)


def test_a_jump_says_where_it_is_and_what_to_do(tmp_path):
    lines = rows()
    lines[14] = "1014,50.5,3.0,20,7.5"
    (note,) = read_track(write(tmp_path, lines)).notes
    assert "first row 15 of the values, at 50.5 N 3 E" in note
    assert "a file for each stretch" in note


def test_a_headerless_file_borrows_its_sibling_s_names(tmp_path):
    sibling = write(tmp_path, rows())
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(rows()))
    assert len(read_track(bare, header_from=sibling).lonlat) == 30


def test_samples_carry_speed_from_the_positions(tmp_path):
    track = read_track(write(tmp_path, rows()))
    survey = survey_of_track(track, "x")
    samples = samples_of_track(track, survey)
    step = np.hypot(1e-5 * 111_240, (1e-5 + 2e-6) * 71_700)
    assert samples.speed_mps[10] == pytest.approx(step, rel=0.01)
    assert set(samples.values) == {"temperature_degc", "ph"}


@needs_tracks
def test_the_real_tracks_are_read():
    assert len(read_track(CHINA).lonlat) == 2655
    for path in sorted(TRACKS.glob("Sunapee*.csv")):
        track = read_track(path, header_from=CHINA)
        assert len(track.lonlat) > 700
        assert {"oxygen_saturation_percent", "chlorophyll_rfu", "sonde_depth_m"} < set(track.values)
        assert "turbidity_ntu" not in track.values
