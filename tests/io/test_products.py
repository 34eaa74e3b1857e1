"""The formats of the maps, accepted and read back by other people's readers."""

import json
import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace

import netCDF4
import numpy as np
import pyogrio
import pystac
import pytest
import rasterio
import shapely
from click.testing import CliRunner
from conftest import ENTRY, FRAME, OXYGEN, TEMPERATURE
from netcdf_checks import CREDITS, NOT_KNOWN, told_of
from pystac.validation.stac_validator import JsonSchemaSTACValidator
from rasterio.warp import transform
from rio_cogeo.cogeo import cog_validate

from grebe.cli.main import grebe
from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN, LIMNOLOGICAL
from grebe.core.samples import Flag, Samples
from grebe.io.export.contours import contour_levels, contour_lines, write_contours
from grebe.io.export.geotiff import write_geotiff
from grebe.io.export.netcdf import write_netcdf
from grebe.io.export.stac import Asset, write_stac_item
from grebe.io.readers.credits import read_credits
from grebe.io.readers.depth import read_depth
from grebe.mapping.covariance.drift import combined, inflow, linear
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import KRIGING, ByShore, with_settings
from grebe.mapping.quality.control import check_quality
from grebe.mapping.series.difference import difference
from grebe.report.tables import area_classes
from grebe.report.texts import LANGUAGES, texts_of
from grebe.report.thresholds import read_profile

WATER = shapely.Polygon([(0, 0), (100, 0), (100, 60), (0, 100)]).difference(
    shapely.box(40, 30, 60, 50)
)
PROFILE = read_profile(None)


def made(shift=0.0, seed=0, settings=None):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 100, (150, 2))
    values = 4.9 + shift + np.sin(positions[:, 0] / 30) + rng.normal(0, 0.05, 150)
    mapper = Mapper(WATER, make_grid(WATER, 2.5), settings or MapSettings(method=KRIGING))
    flags = np.full(150, Flag.GOOD)
    return mapper.map_quantity(OXYGEN, positions, values, flags)


@pytest.fixture(scope="module")
def oxygen():
    return made()


@pytest.mark.filterwarnings("ignore:Passing the dataset to every single check")
def test_the_checkers_of_cf_and_acdd_accept_the_netcdf(oxygen, tmp_path):
    path = tmp_path / "map.nc"
    fields = {each.name: each.probability(oxygen) for each in PROFILE.of(oxygen)}
    key = oxygen.quantity.key
    entry = replace(ENTRY, comment="c", credits=CREDITS)
    write_netcdf(path, [oxygen], FRAME, entry, {key: fields}, {key: oxygen.draws(3)})
    # The CF table has no name for a probability.
    assert sorted(told_of(path)) == sorted(["standard_name", *NOT_KNOWN])
    with netCDF4.Dataset(path) as file:
        assert file[f"{key}_draw"].shape == (3, *oxygen.mean.shape)
        concern = file[f"{key}_concern_1"][:].filled(np.nan)
        assert np.nanmin(concern) >= 0
        assert np.nanmax(concern) <= 1


def test_the_geotiff_is_cloud_optimized_and_lies_where_the_map_does(oxygen, tmp_path):
    path = tmp_path / "oxygen.tif"
    write_geotiff(path, oxygen, FRAME, {"P(x)": oxygen.exceedance(5.0)})
    valid, errors, _ = cog_validate(path, strict=True, quiet=True)
    assert valid, errors
    with rasterio.open(path) as file:
        assert file.descriptions == ("mean", "sd", "P(x)")
        # The value at a longitude and latitude is the map's there.
        rows, columns = np.nonzero(oxygen.grid.inside)
        for i in (0, len(rows) // 2, len(rows) - 1):
            place = (oxygen.grid.north[rows[i]], oxygen.grid.east[columns[i]])
            lon, lat = FRAME.to_wgs84(place)
            x, y = transform("EPSG:4326", file.crs, [lon], [lat])
            mean, sd, probability = next(file.sample([(x[0], y[0])]))
            assert mean == pytest.approx(oxygen.mean[rows[i], columns[i]], abs=1e-5)
            assert sd == pytest.approx(oxygen.sd[rows[i], columns[i]], abs=1e-5)
            assert probability == pytest.approx(
                oxygen.exceedance(5.0)[rows[i], columns[i]], abs=1e-5
            )
        x, y = transform("EPSG:4326", file.crs, *FRAME.to_wgs84([[50.0, 40.0]]).T)
        assert next(file.sample([(x[0], y[0])]))[0] == file.nodata


def test_ogr_reads_the_contours(oxygen, tmp_path):
    path = tmp_path / "contours.gpkg"
    write_contours(path, [oxygen], FRAME)
    meta, _, blobs, (levels,) = pyogrio.raw.read(path, layer=oxygen.quantity.key)
    assert meta["crs"] == "EPSG:4326"
    lines = FRAME.geometry_to_local(shapely.from_wkb(blobs)[0])
    assert len(levels) == len(contour_lines(oxygen)) > 3
    north, east = shapely.get_coordinates(lines)[0]
    row = int(np.argmin(abs(oxygen.grid.north - north)))
    column = int(np.argmin(abs(oxygen.grid.east - east)))
    assert oxygen.mean[row, column] == pytest.approx(levels[0], abs=0.15)
    assert [one.name for one in tmp_path.iterdir()] == ["contours.gpkg"]


@pytest.mark.parametrize("noise", [0.02, 0.5, 2.0])
def test_contours_are_further_apart_than_the_map_errs(tmp_path, noise):
    rng = np.random.default_rng(1)
    positions = rng.uniform(0, 100, (150, 2))
    values = 5.0 + np.sin(positions[:, 0] / 30) + rng.normal(0, noise, 150)
    flags = np.full(150, Flag.GOOD)
    mapper = Mapper(WATER, make_grid(WATER, 5.0), MapSettings(method=KRIGING))
    one = mapper.map_quantity(OXYGEN, positions, values, flags)
    error = 1.96 * np.median(one.sd[one.grid.inside])
    levels = contour_levels(one)
    assert np.all(np.diff(levels) >= error)
    assert len(levels) <= 12
    if np.ptp(one.mean[one.grid.inside]) < error:
        assert contour_lines(one) == []
    # The layer exists even if nothing is drawn.
    write_contours(tmp_path / "c.gpkg", [one], FRAME)
    meta, _, blobs, _ = pyogrio.raw.read(tmp_path / "c.gpkg", layer=OXYGEN.key)
    assert meta["crs"] == "EPSG:4326"
    assert len(blobs) == len(contour_lines(one))


def test_a_full_disk_leaves_nothing_behind(oxygen, tmp_path):
    blocked = tmp_path / "no such folder" / "x.tif"
    with pytest.raises(InputError, match="cannot be written"):
        write_geotiff(blocked, oxygen, FRAME, {})
    with pytest.raises(InputError, match="cannot be written"):
        write_contours(tmp_path / "no such folder" / "c.gpkg", [oxygen], FRAME)


def test_the_probability_of_exceeding_is_that_of_the_normal_distribution(oxygen):
    inside = oxygen.grid.inside
    assert oxygen.exceedance(-1e9)[inside] == pytest.approx(1.0)
    assert oxygen.exceedance(1e9)[inside] == pytest.approx(0.0)
    row, column = np.argwhere(inside)[50]
    level = oxygen.mean[row, column] + 1.96 * oxygen.sd[row, column]
    assert oxygen.exceedance(level)[row, column] == pytest.approx(0.025, abs=1e-4)
    assert np.isnan(oxygen.exceedance(5.0)[~inside]).all()


def test_a_drift_carries_the_map_beyond_the_samples():
    rng = np.random.default_rng(3)
    positions = rng.uniform(0, 50, (80, 2))
    values = 0.1 * positions[:, 0] + rng.normal(0, 0.02, 80)
    flags = np.full(80, Flag.GOOD)
    water = shapely.box(0, 0, 100, 50)
    results = []
    for drift in (None, combined([linear])):
        mapper = Mapper(
            water, make_grid(water, 5.0), MapSettings(method=with_settings(KRIGING, drift=drift))
        )
        one = mapper.map_quantity(TEMPERATURE, positions, values, flags)
        results.append(np.nanmax(one.mean))
    assert results[1] == pytest.approx(9.75, abs=0.5)
    assert results[0] < 9.0
    assert inflow((0.0, 0.0))(np.array([[3.0, 4.0], [0.0, 0.1]])) == pytest.approx(
        np.array([[np.log(5.0)], [0.0]])
    )


def test_a_bathymetry_carries_the_map(tmp_path):
    """The depth and the quantity grow to the north, beyond what was sampled."""
    path = tmp_path / "depth.tif"
    north = np.arange(99.5, 0, -1.0)
    depth = np.repeat((north / 10)[:, None], 60, axis=1).astype("float32")
    depth[:5] = -1.0
    with rasterio.open(
        path, "w", driver="GTiff", height=100, width=60, count=1, dtype="float32", nodata=-1.0,
        crs=FRAME.definition, transform=rasterio.Affine(1, 0, 0, 0, -1, 100),
    ) as file:  # fmt: skip
        file.write(depth, 1)
    at = read_depth(path, FRAME)
    places = np.array([[20.5, 30.5], [60.25, 10.0], [99.5, 30.0]])
    assert at(places)[:, 0] == pytest.approx([2.05, 6.025, 9.45], abs=1e-3)
    rng = np.random.default_rng(1)
    positions = rng.uniform(0, [50, 60], (100, 2))
    values = 0.5 * positions[:, 0] / 10 + rng.normal(0, 0.02, 100)
    water = shapely.box(0, 0, 90, 60)
    mapper = Mapper(
        water,
        make_grid(water, 5.0),
        MapSettings(choice=ByShore(straight=with_settings(KRIGING, drift=at))),
    )
    one = mapper.map_quantity(TEMPERATURE, positions, values, np.full(100, Flag.GOOD))
    assert np.nanmax(one.mean) == pytest.approx(4.4, abs=0.3)


def test_a_raster_that_is_none_is_named(tmp_path):
    path = tmp_path / "depth.tif"
    path.write_text("no raster")
    with pytest.raises(InputError, match=r"depth\.tif"):
        read_depth(path, FRAME)


def test_a_difference_knows_what_is_clear(oxygen):
    later = made(shift=0.5, seed=7)
    change = difference(oxygen, later)
    inside = oxygen.grid.inside
    assert change.mean[inside].mean() == pytest.approx(0.5, abs=0.05)
    assert change.clear[inside].mean() > 0.9
    assert difference(oxygen, made(seed=9)).clear[inside].mean() < 0.15
    with pytest.raises(ValueError, match="same quantity"):
        difference(oxygen, Mapper(WATER, make_grid(WATER, 5.0)).map_quantity(
            OXYGEN, oxygen.positions, oxygen.values, np.full(150, 1)))  # fmt: skip


def test_the_languages_say_the_same_things():
    english, french = (texts_of(one).table for one in LANGUAGES)
    assert set(english) == set(french)
    assert all(set(one.labels) == set(LANGUAGES) for one in BUILTIN.values())
    assert set(english["tests"]) == set(french["tests"])


@pytest.mark.parametrize(
    "text",
    [
        "[[threshold]]\nquantity = 'salt'\nvalue = 1\nsense = 'above'\nlabel = ''\ncitation = ''",
        "[[threshold]]\nquantity = 'ph'\nvalue = 'x'\nsense = 'above'\nlabel = ''\ncitation = ''",
        "[[threshold]]\nquantity = 'ph'\nvalue = 1\nsense = 'over'\nlabel = ''\ncitation = ''",
        "[[threshold]]\nquantity = 'ph'",
        "threshold = 3",
        "[[threshold",
    ],
)
def test_a_profile_that_is_wrong_is_named(tmp_path, text):
    path = tmp_path / "profile.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"profile\.toml"):
        read_profile(path)


def test_a_label_is_a_text_or_one_for_each_language(tmp_path):
    row = 'quantity = "ph"\nvalue = 9.0\nsense = "above"\ncitation = "none"\n'
    path = tmp_path / "profile.toml"
    path.write_text(f'[[threshold]]\n{row}label = "too much"\n')
    (plain,) = read_profile(path).thresholds
    assert plain.label("fr") == "too much"
    path.write_text(f'[[threshold]]\n{row}label.en = "too much"\nlabel.fr = "trop"\n')
    (both,) = read_profile(path).thresholds
    assert (both.label("en"), both.label("fr")) == ("too much", "trop")
    assert all(set(each.labels) == set(LANGUAGES) for each in PROFILE.thresholds)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """Make the demo's survey file as a user does."""
    out = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-c", "from grebe.cli.main import main; main()"]
    subprocess.run([*command, "demo", "--out", str(out)], check=True, capture_output=True)
    return out


def run(*arguments):
    done = CliRunner().invoke(grebe, [str(one) for one in arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


@pytest.mark.slow
def test_the_demo_s_maps_and_the_reports_of_it(demo):
    names = {path.name for path in (demo / "maps").iterdir()}
    assert {"map.nc", "contours.gpkg", *(f"{key}.tif" for key in LIMNOLOGICAL)} <= names
    page = (demo / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 2 + len(LIMNOLOGICAL)
    assert "http://" not in page
    profile = demo / "strict.toml"
    profile.write_text(
        "name = 'strict'\n[[threshold]]\nquantity = 'temperature_degc'\nvalue = 15\n"
        "sense = 'above'\nlabel = 'cold water'\ncitation = 'ours'\n"
    )
    french = demo / "fr.html"
    run("report", demo / "survey.gpkg", "-o", french, "--language", "fr", "--profile", profile)
    text = french.read_text()
    assert (
        "Température : 100\N{NO-BREAK SPACE}% de la surface est probablement au-dessus de 15"
        in text
    )
    assert "Contrôle de qualité" in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no browser is installed")
def test_a_report_is_printed(demo):
    out = demo / "r.html"
    result = json.loads(run("report", demo / "survey.gpkg", "-o", out, "--pdf", "--json"))
    assert (demo / "r.pdf").read_bytes().startswith(b"%PDF")
    assert result["pdf"] == str(demo / "r.pdf")


@pytest.mark.slow
def test_a_change_of_one_quantity_alone_is_found(demo):
    """The later survey's water is two degrees warmer, and otherwise the same."""
    file, later, out = demo / "survey.gpkg", demo / "warmer.gpkg", demo / "diff"
    shutil.copy(file, later)
    with sqlite3.connect(later) as connection:
        connection.execute("UPDATE samples SET temperature_degc = temperature_degc + 2.0")
    connection.close()
    rows = json.loads(run("diff", file, later, "--out", out, "--resolution", 4, "--json"))
    assert set(rows) == set(LIMNOLOGICAL)
    back = json.loads(run("diff", later, file, "--out", demo / "back", "--resolution", 4, "--json"))
    for key, row in rows.items():
        warmer = 2.0 if key == "temperature_degc" else 0.0
        assert row["mean_difference"] == pytest.approx(warmer, abs=1e-3)
        assert back[key]["mean_difference"] == pytest.approx(-warmer, abs=1e-3)
        assert row["changed_share"] == (1.0 if warmer else 0.0)
        with rasterio.open(out / f"{key}_difference.tif") as tiff:
            assert np.nanmean(tiff.read(1, masked=True).filled(np.nan)) == pytest.approx(
                warmer, abs=1e-3
            )


def test_the_item_beside_the_maps_is_what_a_catalogue_takes_in(tmp_path):
    outline = shapely.Polygon([(3.17, 50.63), (3.17, 50.64), (3.18, 50.64)])
    entry = replace(ENTRY, outline=outline, credits=CREDITS)
    assets = [
        Asset(path=tmp_path / "ph.tif", title="pH", bands=[("mean", ""), ("sd", "")]),
        Asset(path=tmp_path / "map.nc", title="all quantities"),
    ]
    write_stac_item(tmp_path / "item.json", entry, assets, {"proj:code": None})
    item = pystac.Item.from_file(str(tmp_path / "item.json"))
    assert item.bbox == list(outline.bounds)
    assert item.properties["license"] == CREDITS["license"]
    assert item.common_metadata.start_datetime.timestamp() == entry.first_s
    assert item.common_metadata.end_datetime.timestamp() == entry.last_s
    assert shapely.geometry.shape(item.geometry).exterior.is_ccw
    assert item.assets["ph.tif"].media_type == pystac.MediaType.COG
    assert item.assets["map.nc"].get_absolute_href() == str(tmp_path / "map.nc")


def test_the_item_keeps_to_the_schema_of_the_specification(simulated_survey, tmp_path):
    """A complete set of maps passes the schemas of STAC 1.1.0 that come with pystac.

    It also meets the projection extension, whose schema is only on the net.
    """
    out = tmp_path / "maps"
    run("map", simulated_survey[0], "--out", out, "--resolution", "8", "--json")
    item = json.loads((out / "item.json").read_text())
    validator = JsonSchemaSTACValidator()
    validator.validate_core(item, pystac.STACObjectType.ITEM, "1.1.0")
    for broken in ({"bbox": None}, {"geometry": 3}, {"assets": {"a": {}}}, {"id": ""}):
        with pytest.raises(pystac.STACValidationError):
            validator.validate_core(item | broken, pystac.STACObjectType.ITEM, "1.1.0")
    told = item["properties"]
    assert told["proj:code"] is None
    assert told["proj:wkt2"].startswith("PROJCRS")
    rasters = [name for name in item["assets"] if name.endswith(".tif")]
    assert rasters
    for name in rasters:
        with rasterio.open(out / name) as file:
            assert told["proj:shape"] == list(file.shape)
            assert told["proj:transform"] == pytest.approx(list(file.transform)[:6])
            bands = [one["name"] for one in item["assets"][name]["bands"]]
            assert len(bands) == file.count
    assert {out / name for name in item["assets"]} <= set(out.iterdir())


def test_credits_that_are_not_texts_are_refused_by_name(tmp_path):
    path = tmp_path / "credits.toml"
    path.write_text("creator_name = 'Jane'\nlicence = 'CC0'\n")
    with pytest.raises(InputError, match="licence"):
        read_credits(path)
    path.write_text("creator_name = 'Jane'\n")
    assert read_credits(path).said() == {"creator_name": "Jane"}


def test_the_shares_of_all_classes_are_the_whole_area(oxygen):
    classes = area_classes(oxygen)
    assert len(classes) > 2
    assert sum(each.share for each in classes) == pytest.approx(1.0)
    assert [each.high for each in classes[:-1]] == [each.low for each in classes[1:]]


def test_every_test_of_quality_has_a_name_in_each_language():
    columns = {
        "temperature_degc": np.full(40, 20.0),
        "specific_conductance_uscm": np.full(40, 99.0),
    }
    samples = Samples.of(
        times=np.arange(40.0), positions=np.zeros((40, 2)), values=columns, quantities=BUILTIN,
        speed_mps=np.ones(40),
    )  # fmt: skip
    counts = check_quality(samples, shapely.box(-9, -9, 9, 9)).counts
    names = {name for tests in counts.values() for name in tests}
    assert {"bubbles", "excursion", "settling", "out of water", "flat line"} <= names
    for language in LANGUAGES:
        assert names <= set(texts_of(language)["tests"])
