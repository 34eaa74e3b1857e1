"""Times that are counted from a start, in the unit that their header names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from grebe.io.readers.track import RawTrack, read_track

BOOT_S = 1_073.0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "track.csv"


def read(path: Path, names: str, cell: Callable[[int], object]) -> RawTrack:
    rows = [f"{cell(k)},{44.4 + 1e-5 * k:.5f},-69.6,20" for k in range(20)]
    path.write_text("\n".join([f"{names},lat,lon,temp", *rows]))
    return read_track(path)


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        ("Time[ms]", 1e3),
        ("Time (ms)", 1e3),
        ("time_ms", 1e3),
        ("time_boot_ms", 1e3),
        ("ms", 1e3),
        ("millis", 1e3),
        ("Time (milliseconds)", 1e3),
        ("us", 1e6),
        ("micros", 1e6),
        ("TimeUS", 1e6),
        ("Time [µs]", 1e6),
        ("Time (ns)", 1e9),
        ("Time (s)", 1.0),
        ("Time (min)", 1 / 60),
        ("Time elapsed [h]", 1 / 3600),
    ],
)
@pytest.mark.parametrize("begin_s", [0.0, BOOT_S])
def test_a_counter_is_in_the_unit_of_its_header(
    path: Path, name: str, scale: float, begin_s: float
) -> None:
    track = read(path, name, lambda k: repr((begin_s + k) * scale))
    assert track.times == pytest.approx(begin_s + np.arange(20))


def test_milliseconds_since_1970_are_what_they_were(path: Path) -> None:
    track = read(path, "time_ms", lambda k: 1_719_998_100_000 + 1000 * k)
    assert track.times is not None
    assert track.times.tolist() == [1_719_998_100.0 + k for k in range(20)]


def test_a_siemens_is_no_second(path: Path) -> None:
    """The conductivity of a file without times used to become its clock."""
    track = read(path, "uS", lambda k: 400 + k)
    assert track.times is None


@pytest.mark.parametrize(
    ("names", "stamp"),
    [
        ("Time[ms],DateTime", "2024-07-03 09:15:{k:02}"),
        ("millis,datetime", "2024-07-03 09:15:{k:02}"),
        ("Time[ms],Date,Time", "2024-07-03,09:15:{k:02}"),
        ("TimeUS,Date,Time", "2024-07-03,09:15:{k:02}"),
    ],
)
def test_a_date_counts_before_a_counter(path: Path, names: str, stamp: str) -> None:
    """A counter of microseconds may be as large as seconds since 1970."""
    track = read(path, names, lambda k: f"{1_719_998_100 + k},{stamp.format(k=k)}")
    assert track.times is not None
    assert track.times.tolist() == [1_719_998_100.0 + k for k in range(20)]
    assert names.partition(",")[0] in track.unused
