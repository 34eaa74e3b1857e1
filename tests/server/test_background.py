"""A user's own background map: its two formats, and files of neither."""

from __future__ import annotations

import io
import sqlite3

import pytest

pytest.importorskip("starlette")
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer
from server.test_server import HOSTS, on_event, run

from grebe.core.errors import InputError
from grebe.server.app import make_app
from grebe.server.background import open_background, shown
from grebe.server.security import Keys

# Lake Geneva, in the scheme of web maps, whose y counts from the north.
PLACE = (10, 530, 363)
IMAGE = b"\x89PNG not really"
SAID = {"name": "Shore", "attribution": "<a href='x'>© OpenStreetMap</a>"}


def packed(path, kind=TileType.PNG):
    """A file made by the reference writer of PMTiles."""
    sheet = io.BytesIO()
    writer = Writer(sheet)
    writer.write_tile(zxy_to_tileid(*PLACE), IMAGE)
    header = {
        "tile_type": kind, "tile_compression": Compression.NONE,
        "min_lon_e7": int(6.3e7), "min_lat_e7": int(46.3e7),
        "max_lon_e7": int(6.7e7), "max_lat_e7": int(46.6e7),
        "center_zoom": 10, "center_lon_e7": 0, "center_lat_e7": 0,
    }  # fmt: skip
    writer.finalize(header, SAID)
    path.write_bytes(sheet.getvalue())
    return path


def stored(path, kind="png"):
    """A file after the specification of MBTiles, whose rows count from the south."""
    zoom, x, y = PLACE
    with sqlite3.connect(path) as rows:
        rows.execute("CREATE TABLE metadata (name text, value text)")
        rows.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data blob)")
        told = {**SAID, "format": kind, "bounds": "6.3,46.3,6.7,46.6"}
        rows.executemany("INSERT INTO metadata VALUES (?, ?)", told.items())
        rows.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (zoom, x, 2**zoom - 1 - y, IMAGE))
    rows.close()
    return path


@pytest.mark.parametrize("make", [packed, stored])
def test_a_tile_is_found_where_it_lies_and_its_makers_are_named_without_their_html(make, tmp_path):
    kind = {packed: "shore.pmtiles", stored: "shore.mbtiles"}[make]
    background = open_background(make(tmp_path / kind))
    zoom, x, y = PLACE
    assert background.tile(zoom, x, y) == IMAGE
    assert background.tile(zoom, x, 2**zoom - 1 - y) is None
    assert shown(background) == {
        "name": "Shore", "min_zoom": 10, "max_zoom": 10,
        "bounds": (6.3, 46.3, 6.7, 46.6), "attribution": "© OpenStreetMap",
    }  # fmt: skip


@pytest.mark.parametrize(("make", "kind"), [(packed, TileType.MVT), (stored, "pbf")])
def test_tiles_of_vectors_are_refused_with_what_to_give(make, kind, tmp_path):
    name = {packed: "x.pmtiles", stored: "x.mbtiles"}[make]
    with pytest.raises(InputError, match="give a file of images"):
        open_background(make(tmp_path / name, kind))


@pytest.mark.parametrize("name", ["x.pmtiles", "x.mbtiles", "x.zip"])
@pytest.mark.parametrize(
    "content", [b"", b"PMTiles\x03", b"SQLite format 3\x00", b"PMTiles\x02" * 40]
)
def test_a_file_that_is_none_is_named(name, content, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"x\.(pmtiles|mbtiles|zip)"):
        open_background(path)
    with pytest.raises(InputError, match=r"cannot be read|not a background map"):
        open_background(path.with_name("none" + path.suffix))


@pytest.mark.parametrize(
    ("place", "status"),
    [("10/530/363", 200), ("10/530/364", 204), ("10/-1/0", 404), ("99/0/0", 204), ("1/9/9", 204),
     ("10/530/" + "9" * 400, 204), ("1/1/..%2f..", 404), ("1/1/²", 404)],
)  # fmt: skip
def test_the_server_hands_out_tiles_and_nothing_else(place, status, tmp_path):
    keys = Keys(tmp_path, 8737)
    background = open_background(packed(tmp_path / "x.pmtiles"))
    app = make_app(tmp_path, keys, HOSTS, background)
    headers = {"host": "127.0.0.1:8737", "authorization": f"Bearer {keys.bearer}"}
    found, said, body = run(on_event(app, f"/api/background/{place}", "GET", b"", **headers))
    assert found == status
    if status == 200:
        assert (said["content-type"], body) == ("image/png", IMAGE)
