"""A track in every format that a boat or a handheld writes.

Each is read as the same path, and a sonde's file is joined to each by the clock.
"""

import io
import json
import struct
from datetime import UTC, datetime

import numpy as np
import pytest
from click.testing import CliRunner
from identification.dataflash import DataflashWriter

from grebe.cli.main import grebe
from grebe.core.errors import InputError, TrackError
from grebe.io.readers.track import read_track

BEGIN = datetime(2026, 6, 1, 9, 0, tzinfo=UTC).timestamp()
SECONDS = 240
# Two lanes there and back, so that the track has an area.
LAT = 45.5 + 1e-5 * np.minimum(np.arange(SECONDS), 239 - np.arange(SECONDS))
LON = -71.2 + 2e-4 * (np.arange(SECONDS) >= 120) * np.minimum((np.arange(SECONDS) - 119) / 10, 1.0)
DEPTH = 4 + np.arange(SECONDS) / 100


def gpx(path):
    points = "".join(
        f'<trkpt lat="{LAT[k]:.7f}" lon="{LON[k]:.7f}"><ele>152.1</ele>'
        f"<time>{datetime.fromtimestamp(BEGIN + k, UTC):%Y-%m-%dT%H:%M:%SZ}</time><extensions>"
        f"<g:TrackPointExtension><g:depth>{DEPTH[k]:.2f}</g:depth></g:TrackPointExtension>"
        "</extensions></trkpt>"
        for k in range(SECONDS)
    )
    path.write_text(
        '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1" '
        'xmlns:g="http://www.garmin.com/xmlschemas/TrackPointExtension/v2">'
        f"<trk><trkseg>{points}</trkseg></trk></gpx>"
    )


def telemetry(path):
    mavlink = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    boat = mavlink.MAVLink(io.BytesIO(), srcSystem=7, srcComponent=1)
    data = bytearray()

    def say(message, second):
        # The station's own clock is an hour slow; the receiver's is the one that counts.
        stamp = int((BEGIN - 3600 + second) * 1e6)
        data.extend(struct.pack(">Q", stamp) + message.pack(boat))

    for k in range(SECONDS):
        ms = 50_000 + 1000 * k
        say(boat.system_time_encode(int((BEGIN + k) * 1e6), ms), k)
        say(boat.water_depth_encode(ms, 0, 1, 0, 0, 0, 0, 0, 0, DEPTH[k], 18.5), k)
        lat, lon = round(LAT[k] * 1e7), round(LON[k] * 1e7)
        say(boat.global_position_int_encode(ms, lat, lon, 0, 0, 0, 0, 0, 0), k)
    path.write_bytes(data)


def dataflash(path):
    pytest.importorskip("pymavlink")
    log = DataflashWriter()
    log.define("GPS", "QBBIHBcLLfff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs")
    log.define("POS", "QLLffff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt,Extra")
    log.define("DPTH", "QBLLf", "TimeUS,Inst,Lat,Lng,Depth")
    # Weeks since 1980-01-06, by a clock that is 18 leap seconds ahead of UTC.
    since = BEGIN - datetime(1980, 1, 6, tzinfo=UTC).timestamp() + 18
    for k in range(SECONDS):
        us = 50_000_000 + 1_000_000 * k
        week, rest = divmod(since + k, 7 * 86400)
        log.row(
            "GPS", us, 0, 4, round(rest * 1000), int(week), 14, 0.8, LAT[k], LON[k], 15000, 1.0, 0.0
        )
        log.row("DPTH", us, 0, LAT[k], LON[k], DEPTH[k])
        log.row("POS", us, LAT[k], LON[k], 150.0, 0.0, 0.0, 0.0)
    path.write_bytes(bytes(log.data))


def sentences(path):
    def checked(text):
        total = 0
        for one in text.encode():
            total ^= one
        return f"${text}*{total:02X}\r\n"

    def minutes(angle, width):
        whole, rest = divmod(abs(angle), 1)
        return f"{int(whole):0{width}d}{60 * rest:08.5f}"

    lines = []
    for k in range(SECONDS):
        when = datetime.fromtimestamp(BEGIN + k, UTC)
        place = f"{minutes(LAT[k], 2)},N,{minutes(LON[k], 3)},W"
        lines.append(checked(f"SDDPT,{DEPTH[k] - 0.3:.2f},0.3"))
        lines.append(checked(f"GPGGA,{when:%H%M%S},{place},1,9,0.9,150,M,0,M,,"))
        lines.append(checked(f"GPRMC,{when:%H%M%S},A,{place},2.0,0.0,{when:%d%m%y},,"))
    path.write_text("".join(lines))


WRITERS = {"t.gpx": gpx, "t.tlog": telemetry, "t.bin": dataflash, "t.nmea": sentences}


@pytest.mark.parametrize("name", WRITERS)
def test_every_log_gives_the_same_path(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path)
    track = read_track(path)
    assert track.times == pytest.approx(BEGIN + np.arange(SECONDS), abs=0.01)
    assert track.lonlat == pytest.approx(np.column_stack([LON, LAT]), abs=2e-7)
    assert track.values["water_depth_m"] == pytest.approx(DEPTH, abs=0.006)


@pytest.mark.parametrize("name", WRITERS)
def test_a_sonde_s_file_is_joined_to_each(tmp_path, name):
    path, sonde = tmp_path / name, tmp_path / "sonde.csv"
    WRITERS[name](path)
    sonde.write_text(
        "Date Time,pH\n"
        + "\n".join(
            f"{datetime.fromtimestamp(BEGIN + k, UTC):%Y-%m-%d %H:%M:%S},{7 + k / 1e3:.3f}"
            for k in range(10, 230)
        )
    )
    out = tmp_path / "out.gpkg"
    done = CliRunner().invoke(
        grebe, ["import", str(path), "--with", str(sonde), "-o", str(out), "--json"]
    )
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["samples"] == 220
    assert {"ph", "water_depth_m"} <= set(told["good"])


def test_a_gpx_of_waypoints_alone_is_no_track(tmp_path):
    path = tmp_path / "t.gpx"
    path.write_text('<gpx version="1.1"><wpt lat="45" lon="3"/></gpx>')
    with pytest.raises(TrackError, match="holds no track"):
        read_track(path)


def test_a_torn_gpx_says_so(tmp_path):
    path = tmp_path / "t.gpx"
    gpx(path)
    path.write_text(path.read_text()[:5000])
    with pytest.raises(InputError, match="not well-formed XML"):
        read_track(path)


def test_sentences_without_a_date_say_what_is_wanted(tmp_path):
    path = tmp_path / "t.nmea"
    sentences(path)
    path.write_text("\n".join(line for line in path.read_text().splitlines() if "RMC" not in line))
    with pytest.raises(TrackError, match="set the receiver to send RMC"):
        read_track(path)
