"""Files of version 0.1.0 are brought up to date, and nothing in them is lost.

The files in `tests/data` were made by that version, with made-up water: a plan with cells drawn in
to cores, a mission, and an imported track. SQLite first reads from them what they must hold.
"""

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import shapely

from grebe.core.errors import SurveyFileError
from grebe.core.quantities import LIMNOLOGICAL
from grebe.io.store import SurveyFile, database, schema
from grebe.io.store.timestamps import parse_time

DATA = Path(__file__).parents[1] / "data"
OLD = ("core_0_1_0.gpkg", "mission_0_1_0.gpkg", "track_0_1_0.gpkg")
KEPT = {
    "targets": "seq, kind, speed_min_mps, speed_max_mps, reached_at, sample_count, geom",
    "track": "time, north_m, thrust_port_n, target_seq, split_stage, status, geom",
    "samples": "time, target_seq, speed_mps, geom, temperature_degc, ph, ph_qc, turbidity_ntu",
    "events": "time, level, code, message",
    "corridors": "seq, geom",
}


def rows(path, table, columns):
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute(f"SELECT {columns} FROM {table} ORDER BY fid").fetchall()


@pytest.fixture(params=OLD)
def old(request, tmp_path):
    return Path(shutil.copy(DATA / request.param, tmp_path / request.param))


def version_of(path):
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute("PRAGMA user_version").fetchone()[0]


def test_every_value_flag_target_and_event_stays(old):
    before = {table: rows(old, table, columns) for table, columns in KEPT.items()}
    assert version_of(old) == 2
    with SurveyFile.open(old) as file:
        samples, events = file.samples(), file.events()
        quantities = file.quantities
    assert version_of(old) == schema.VERSION
    assert {table: rows(old, table, columns) for table, columns in KEPT.items()} == before
    assert quantities == LIMNOLOGICAL
    assert len(samples) == len(before["samples"])
    read = np.column_stack([samples.values["temperature_degc"], samples.values["ph"]])
    told = np.array([row[4:6] for row in before["samples"]], dtype=float).reshape(-1, 2)
    assert np.array_equal(read, told, equal_nan=True)
    for i, row in enumerate(before["samples"]):
        assert samples.moment(i) == parse_time(row[0])
    assert [(one.code, one.message) for one in events] == [row[2:] for row in before["events"]]


def test_a_migrated_file_is_migrated_once_and_stays_the_same(old):
    with SurveyFile.open(old) as file:
        first = file.survey
    with SurveyFile.open(old) as file:
        assert file.survey.settings == first.settings
        assert [t.set for t in file.survey.targets] == [t.set for t in first.targets]


def test_the_settings_of_a_plan_are_typed_and_what_was_not_kept_is_the_default(tmp_path):
    path = Path(shutil.copy(DATA / "core_0_1_0.gpkg", tmp_path))
    said = json.loads(dict(rows(path, "meta", "key, value"))["settings"])
    with SurveyFile.open(path) as file:
        settings = file.survey.settings
    assert (settings.cell_m, settings.core) == (said["cell_m"], said["core"]) == (12.0, 0.5)
    assert settings.weather.current_north_mps == said["current_north_mps"] == 0.2
    assert (settings.pattern, settings.returns, settings.minutes) == ("free", False, None)


def test_a_target_drawn_in_to_its_core_gets_its_cell_back(tmp_path):
    path = Path(shutil.copy(DATA / "core_0_1_0.gpkg", tmp_path))
    with SurveyFile.open(path) as file:
        survey = file.survey
    for target in survey.targets:
        assert target.set.polygon.area == pytest.approx(0.25 * target.cell.area, rel=1e-6)
        assert target.cell.buffer(1e-6).contains(target.set.polygon)
        assert survey.water.buffer(1e-3).contains(target.cell)
    # The plan left out a margin along the shore.
    assert 0.9 < survey.coverage < 1.0


def test_an_imported_track_has_no_plan(tmp_path):
    path = Path(shutil.copy(DATA / "track_0_1_0.gpkg", tmp_path))
    with SurveyFile.open(path) as file:
        assert file.survey.settings is None
        assert file.survey.outcome is None
        assert not file.survey.targets
        assert isinstance(file.survey.water, shapely.Polygon)


def test_a_file_that_another_process_has_is_left_as_it_was(old, monkeypatch):
    monkeypatch.setattr(database, "TIMEOUT_S", 0.1)
    with closing(sqlite3.connect(old)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(SurveyFileError, match="writ"):
            SurveyFile.open(old)
    assert version_of(old) == 2
    with SurveyFile.open(old):
        assert version_of(old) == schema.VERSION


def test_a_step_that_fails_leaves_the_file_as_it_was(old, monkeypatch):
    from grebe.io.store import migrations

    def broken(connection):
        connection.execute("CREATE TABLE half_done (a)")
        raise sqlite3.OperationalError("disk is full")

    steps = (*migrations.STEPS, (schema.VERSION, broken))
    monkeypatch.setattr(migrations, "STEPS", steps)
    before = rows(old, "meta", "key, value")
    with pytest.raises(SurveyFileError, match="left as it was"):
        SurveyFile.open(old)
    assert version_of(old) == 2
    assert rows(old, "meta", "key, value") == before
