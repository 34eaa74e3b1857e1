"""Many surveys are mapped like single ones, and the failure of one does not affect the others."""

import json
from datetime import timedelta

import numpy as np
import pytest
import xarray
from click.testing import CliRunner
from conftest import NOON, square_survey

from grebe.campaigns.engine import Serial
from grebe.campaigns.maps import MapTask, map_many
from grebe.cli.main import grebe
from grebe.core.errors import UsageError
from grebe.core.samples import Sample
from grebe.io.store import SurveyFile
from grebe.mapping.maps import MapSettings
from grebe.workflow.files import write_survey


def measured(path, seed):
    random = np.random.default_rng(seed)
    write_survey(path, square_survey(40.0))
    samples = [
        Sample(
            time=NOON + timedelta(seconds=i),
            north_m=float(north),
            east_m=float(east),
            target_seq=None,
            speed_mps=1.0,
            values={"temperature_degc": 15 + 0.05 * north + float(random.normal(0, 0.05))},
            flags={"temperature_degc": 1},
        )
        for i, (north, east) in enumerate(random.uniform(1, 39, (40, 2)))
    ]
    with SurveyFile.open(path) as file:
        file.append_samples(samples)
    return path


def values(folder):
    with xarray.open_dataset(folder / "map.nc") as maps:
        return maps["temperature_degc"].values


@pytest.mark.slow
def test_many_surveys_are_mapped_as_one_is_and_a_broken_one_is_reported(tmp_path):
    files = [measured(tmp_path / f"{name}.gpkg", i) for i, name in enumerate("ab", 1)]
    broken = tmp_path / "broken.gpkg"
    broken.write_text("no survey")
    words = [
        "map",
        "--many",
        *map(str, [*files, broken]),
        "--out",
        str(tmp_path / "maps"),
        "--resolution",
        "5",
    ]
    first = CliRunner().invoke(grebe, [*words, "--workers", "2", "--json"])
    told = json.loads(first.stdout)
    assert [name.split("/")[-1] for name in told["mapped"]] == ["a", "b"]
    assert len(told["not_mapped"]) == 1
    assert "broken" in told["not_mapped"][0]
    assert first.exception.exit_code == 3
    again = CliRunner().invoke(grebe, [*words, "--workers", "1", "--json"])
    assert len(json.loads(again.stdout)["mapped_before"]) == 2
    alone = CliRunner().invoke(
        grebe, ["map", str(files[0]), "--out", str(tmp_path / "one"), "--resolution", "5"]
    )
    assert alone.exit_code == 0
    np.testing.assert_array_equal(values(tmp_path / "one"), values(tmp_path / "maps" / "a"))


def test_two_of_one_name_are_refused(tmp_path):
    files = [tmp_path / "x" / "s.gpkg", tmp_path / "y" / "s.gpkg"]
    with pytest.raises(UsageError, match="called s"):
        map_many(files, MapTask(out=tmp_path, settings=MapSettings()), Serial())


def test_several_need_to_be_asked_for(tmp_path):
    result = CliRunner().invoke(grebe, ["map", "a.gpkg", "b.gpkg", "--out", str(tmp_path)])
    assert isinstance(result.exception, UsageError)
    assert "--many" in str(result.exception)
