"""One file of the user's takes a quantity unknown to Grebe from the track to the report."""

import json

import netCDF4
import numpy as np
import pytest
from click.testing import CliRunner
from conftest import region_of

from grebe.cli.main import grebe
from grebe.core.errors import InputError, SurveyFileError, TrackError
from grebe.core.plan_settings import PlanSettings
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.workflow.files import write_survey

OWN = """
[tryptophan_rfu]
label = { en = "Tryptophan", fr = "Tryptophane" }
unit = "RFU"
cf_unit = "1"
span = [0, 100]
resolution = 0.01
columns = ['trp(rfu)?']
limits = { suspect_span = [0, 50], spike_suspect = 5, spike_fail = 20, rate_per_s = 5 }
lake = { mean = 12, sd = 2, range_share = 0.6, structured_share = 0.9 }
colormap = "viridis"
"""
PROFILE = """
name = "own"
[[threshold]]
quantity = "tryptophan_rfu"
value = 12.0
sense = "above"
label = "sewage?"
citation = "none"
"""


def run(*arguments):
    done = CliRunner().invoke(grebe, [str(one) for one in arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.output


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(OWN)
    return path


@pytest.fixture
def track(tmp_path):
    """Write lanes over a made-up pond; one value is impossible, one a spike."""
    rng = np.random.default_rng(7)
    i = np.arange(200)
    lane, place = i // 20, i % 20
    x = 2.0 * np.where(lane % 2 == 0, place, 19 - place)
    y = 4.0 * lane
    values = 10 + 0.05 * x + 0.02 * y + rng.normal(0, 0.05, 200)
    values[30], values[60] = 400.0, 45.0
    lines = ["time,lat,lon,Trp RFU"]
    lines += [
        f"{1.75e9 + 2 * k:.0f},{50.63 + y[k] / 111200:.7f},"
        f"{3.17 + x[k] / 70700:.7f},{values[k]:.3f}"
        for k in i
    ]
    path = tmp_path / "track.csv"
    path.write_text("\n".join(lines))
    return path


def held(path, tmp_path):
    """Map and report a file, and return what the products say about the new quantity."""
    profile = tmp_path / "profile.toml"
    profile.write_text(PROFILE)
    run("map", path, "--out", tmp_path / "maps", "--resolution", 5, "--profile", profile)
    run("report", path, "-o", tmp_path / "r.html", "--resolution", 10, "--language", "fr",
        "--profile", profile)  # fmt: skip
    with netCDF4.Dataset(tmp_path / "maps" / "map.nc") as dataset:
        variable = dataset["tryptophan_rfu"]
        assert variable.reported_unit == "RFU"
        assert variable.units == "1"
        assert "standard_name" not in variable.ncattrs()
        assert "P(tryptophan_rfu > 12)" in dataset["tryptophan_rfu_concern_1"].long_name
        mean = variable[:]
    assert (tmp_path / "maps" / "tryptophan_rfu.tif").exists()
    return mean, (tmp_path / "r.html").read_text()


def test_imported_checked_mapped_and_reported(tmp_path, own, track):
    path = tmp_path / "s.gpkg"
    run("import", track, "-o", path, "--quantities", own)
    own.unlink()  # the survey file's declaration is complete
    with SurveyFile.open(path) as file:
        assert list(file.quantities) == ["tryptophan_rfu"]
        assert file.quantities["tryptophan_rfu"].limits.spike_fail == 20.0
        samples = file.samples()
    flags = samples.flags["tryptophan_rfu"]
    assert (flags[30], flags[60]) == (Flag.FAIL, Flag.FAIL)
    assert (flags == Flag.GOOD).sum() >= 195
    assert samples.values["tryptophan_rfu"][30] == 400.0
    mean, page = held(path, tmp_path)
    assert 9.5 < mean.min() < mean.max() < 13.5
    assert "Tryptophane" in page
    assert "sewage?" in page
    shown = json.loads(run("show", path, "--json"))
    assert shown["quantities"] == ["tryptophan_rfu"]


def test_planned_simulated_mapped_and_reported(tmp_path, own):
    path = tmp_path / "s.gpkg"
    outline = tmp_path / "pond.geojson"
    ring = [[3.1700, 50.6360], [3.1705, 50.6360], [3.1705, 50.6363], [3.1700, 50.6363],
            [3.1700, 50.6360]]  # fmt: skip
    outline.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    own.rename(tmp_path / "quantities.toml")  # it is found beside the survey
    run("plan", outline, "-o", path, "--cell", 8)
    run("run", path)
    with SurveyFile.open(path) as file:
        assert list(file.quantities) == [*LIMNOLOGICAL, "tryptophan_rfu"]
        samples = file.samples()
    assert np.isfinite(samples.values["tryptophan_rfu"]).all()
    assert abs(samples.values["tryptophan_rfu"].mean() - 12) < 4
    _, page = held(path, tmp_path)
    assert page.count("Tryptophane") >= 3
    assert "Température" in page


def test_a_mission_may_declare_it_at_its_start(tmp_path, own):
    path = tmp_path / "s.gpkg"
    survey = plan_survey(
        region_of([(0, 0), (20, 0), (20, 20), (0, 20)]),
        PRESETS["spyboat"],
        PlanSettings(cell_m=10.0),
    )
    write_survey(path, survey, force=False)
    run("run", path, "--quantities", own)
    with SurveyFile.open(path) as file:
        assert np.isfinite(file.samples().values["tryptophan_rfu"]).all()


def test_what_is_not_declared_is_refused(tmp_path, own, track):
    with pytest.raises(InputError, match="no column of a known quantity"):
        run("import", track, "-o", tmp_path / "s.gpkg")
    assert not (tmp_path / "s.gpkg").exists()
    with pytest.raises(TrackError, match="'salt', which is neither time, date, lat, lon nor a"):
        run("import", track, "-o", tmp_path / "s.gpkg", "--column", "salt=Trp RFU")
    run("import", track, "-o", tmp_path / "s.gpkg", "--column", "chlorophyll_rfu=Trp RFU")
    with SurveyFile.open(tmp_path / "s.gpkg") as file:
        samples = file.samples()
        renamed = {"ph": samples.values["chlorophyll_rfu"]}
        strange = type(samples)(**{**vars(samples), "values": renamed,
                                   "flags": {"ph": samples.flags["chlorophyll_rfu"]}})  # fmt: skip
        with pytest.raises(
            SurveyFileError, match="does not declare ph; it declares chlorophyll_rfu"
        ):
            file.extend_samples(strange)
        other = LIMNOLOGICAL.subset(["ph"])
        file.declare(other)
        file.extend_samples(strange)
        assert file.samples().measured("ph")


def test_one_key_has_one_unit_in_a_file(tmp_path, own, track):
    path = tmp_path / "s.gpkg"
    run("import", track, "-o", path, "--quantities", own)
    other = tmp_path / "other.toml"
    other.write_text(OWN.replace('unit = "RFU"', 'unit = "ppb"'))
    with pytest.raises(SurveyFileError, match="holds tryptophan_rfu in RFU"):
        run("run", path, "--quantities", other)


def test_columns_of_many_samples_are_as_those_appended_one_by_one(tmp_path, track, own):
    run("import", track, "-o", tmp_path / "a.gpkg", "--quantities", own)
    with SurveyFile.open(tmp_path / "a.gpkg") as file:
        samples, survey, quantities = file.samples(), file.survey, file.quantities
    plan = Survey(name=survey.name, frame=survey.frame, water=survey.water)
    with SurveyFile.create(
        tmp_path / "b.gpkg", plan, meta={}, force=False, quantities=quantities
    ) as file:
        file.extend_samples(samples.rows(slice(0, 150)))
        file.extend_samples(samples.rows(slice(150, None)))
        again = file.samples()
    assert again.times.tolist() == samples.times.tolist()
    assert np.abs(again.positions - samples.positions).max() < 1e-6
    for key, column in samples.values.items():
        assert np.array_equal(again.values[key], column)
        assert np.array_equal(again.flags[key], samples.flags[key])
