"""Options that cokriging would ignore are refused; others are accepted."""

import pytest
from click.testing import CliRunner
from conftest import FRAME, square_survey

from grebe.cli.main import grebe
from grebe.cli.mapping_options import settings_with
from grebe.core.errors import InputError, UsageError
from grebe.mapping.scale import LINEAR
from grebe.workflow.files import write_survey

TOGETHER = ("--together", "ph,temperature_degc")
PLAIN = {
    "method": None, "variogram": None, "drift": None, "inflows": (), "depth": None,
    "estimator": "matheron", "shore_depth_sd_m": None, "moment": None, "scale": None,
    "together": ("ph", "temperature_degc"),
}  # fmt: skip


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    path = tmp_path_factory.mktemp("together") / "s.gpkg"
    write_survey(path, square_survey())
    return path


def told(command, survey, *asked):
    arguments = [command, str(survey), *asked]
    return CliRunner().invoke(grebe, arguments).exception


@pytest.mark.parametrize(
    "asked",
    [
        ("--drift", "linear"),
        ("--inflow", f"{FRAME.origin_lon_deg},{FRAME.origin_lat_deg}"),
        ("--variogram", "reml"),
        ("--method", "passes"),
        ("--method", "spde"),
        ("--estimator", "dowd"),
    ],
    ids=" ".join,
)
def test_options_that_cokriging_ignores_are_refused(survey, tmp_path, asked):
    for command, out in (("map", "--out"), ("report", "-o")):
        error = told(command, survey, out, str(tmp_path / "out"), *TOGETHER, *asked)
        assert isinstance(error, UsageError), error
        assert f"ignores {asked[0]}" in str(error)
        assert not (tmp_path / "out").exists()


def test_a_raster_of_depths_and_many_surveys_are_refused_too(survey, tmp_path):
    with pytest.raises(UsageError, match="ignores --depth"):
        settings_with(PLAIN | {"depth": survey}, None)
    out = ("--many", "--out", str(tmp_path / "out"))
    error = told("map", survey, *out, *TOGETHER, "--drift", "linear")
    assert isinstance(error, UsageError)
    assert "ignores --drift" in str(error)


def test_options_that_cokriging_uses_are_accepted(survey, tmp_path):
    settings = settings_with(
        PLAIN | {"method": "kriging", "scale": "linear", "moment": "middle"}, None
    )
    assert settings.together == PLAIN["together"]
    assert settings.scale is LINEAR
    # The only obstacle is that nothing has been measured yet.
    asked = ("--method", "kriging", "--scale", "linear", "--resolution", "5", "--moment", "middle")
    error = told("map", survey, "--out", str(tmp_path / "out"), *TOGETHER, *asked)
    assert isinstance(error, InputError)
    assert not isinstance(error, UsageError)


def test_without_cokriging_the_same_options_stand(survey):
    for one in ({"variogram": "reml"}, {"method": "passes"}, {"estimator": "dowd"}):
        assert settings_with(PLAIN | {"together": ()} | one, None).together == ()
