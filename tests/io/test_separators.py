"""Tables that are separated by blanks or strokes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from grebe.core.errors import TrackError
from grebe.io.readers.profile import read_profile
from grebe.io.readers.separators import BLANKS, separator
from grebe.io.readers.track import RawTrack, read_track

TIMES = [1_600_000_000 + k for k in range(20)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "track.txt"


def read(path: Path, header: str, row: str, **more: str) -> RawTrack:
    """Read the track of a boat that goes north, from a header and a template of its rows."""
    clocks = [f"{26 + k // 60}:{k % 60:02}" for k in range(40, 60)]
    cells = [
        {"t": 1_600_000_000 + k, "s": clock, "lat": f"{44.4 + 1e-5 * k:.5f}"}
        for k, clock in enumerate(clocks)
    ]
    path.write_text("\n".join([header, *(row.format(**each) for each in cells)]) + "\n")
    return read_track(path, more)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("time lat lon temp ph", "{t} {lat} -69.6 20.5 7"),
        ("# time   lat      lon    temp   ph", "  {t}   {lat}  -69.60  20.50   7.00"),
        ("% time lat lon temp ph", "{t} {lat} -69.6 2.05e+01 7"),
        ("time lat lon temp ph", "{t} {lat} -69,6 20,5 7,0"),
        ('time lat lon "Water temp (C)" ph', "{t} {lat} -69.6 20.5 7"),
        ("Date Time lat lon temp ph", "2020-09-13 12:{s} {lat} -69.6 20.5 7"),
        ("DateTime lat lon temp ph", "2020-09-13 12:{s} {lat} -69.6 20.5 7"),
        ("DateTime lat lon temp ph", "09/13/2020 12:{s} PM {lat} -69.6 20.5 7"),
        ("Date Time            lat       lon    Water temp (C)  pH",
         "2020-09-13 12:{s}  {lat}  -69.6  20.5            7"),
        ("time|lat|lon|temp|ph", "{t}|{lat}|-69.6|20.5|7"),
        ("time | lat | lon | Temp (C) | ph", "{t} | {lat} | -69.6 | 20.5 | 7"),
        ("| time | lat | lon | temp | ph |\n|------|-----|-----|------|----|",
         "| {t} | {lat} | -69.6 | 20.5 | 7 |"),
        (" time | lat | lon | temp | ph \n------+-----+-----+------+----",
         " {t} | {lat} | -69.6 | 20.5 | 7 "),
        ("Date|Time|lat|lon|temp|ph", "2020-09-13|12:{s}|{lat}|-69,6|20,5|7,0"),
    ],
)  # fmt: skip
def test_blanks_and_strokes_separate(path: Path, header: str, row: str) -> None:
    track = read(path, header, row)
    assert track.times is not None
    assert track.times.tolist() == TIMES
    assert track.lonlat[0] == pytest.approx([-69.6, 44.4])
    assert track.values["temperature_degc"] == pytest.approx(np.full(20, 20.5))
    assert track.values["ph"] == pytest.approx(np.full(20, 7.0))


def test_a_name_of_two_words_is_refused_where_blanks_separate(path: Path) -> None:
    """Each value after it would be under another name."""
    with pytest.raises(TrackError, match="header has 6 names and its rows 5 values"):
        read(path, "time lat lon Temp (C) ph", "{t} {lat} -69.6 20.5 7")


def test_names_for_a_file_of_blanks_come_from_a_profile(path: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text('names = ["time", "lat", "lon", "Temp (F)"]')
    path.write_text("\n".join(f"{t} {44.4 + 1e-5 * k:.5f} -69.6 68" for k, t in enumerate(TIMES)))
    track = read_track(path, profile=read_profile(str(own)))
    assert track.values["temperature_degc"] == pytest.approx(np.full(20, 20.0))


@pytest.mark.parametrize(
    ("lines", "mark"),
    [
        (["Date Time,lat", *["2020-09-13 12:26:40,44.4"] * 9], ","),
        (["time,lat,lon", *["2020-09-13 12:26:40,44.4,-69.6,"] * 4, *["2020-09-13 12:26,4,5"] * 3],
         ","),
        (["Date Time;Temp", *["2020-09-13 12:26:40;20,5"] * 9], ";"),
        (["a\tb c", *["1\t2 3"] * 9], "\t"),
        (["a b", *["1,5 2,5"] * 9], BLANKS),
        (["a note of one", "and of two more", *["1|2"] * 9], "|"),
    ],
)  # fmt: skip
def test_a_mark_counts_before_blanks(lines: list[str], mark: str) -> None:
    assert separator(lines) == mark
