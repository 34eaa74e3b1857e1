"""The survey file: round trips, other people's readers, injected failures."""

import shutil
import sqlite3
import subprocess
import sys
from datetime import timedelta

import numpy as np
import pyogrio
import pytest
import shapely
from conftest import NOON, square_survey

from grebe.core.errors import SurveyFileError
from grebe.core.events import LogEntry, Step
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag, Sample
from grebe.io.store import SurveyFile, geopackage


@pytest.fixture
def path(tmp_path):
    return tmp_path / "s.gpkg"


@pytest.fixture
def survey_file(path):
    with SurveyFile.create(path, square_survey(), meta={"survey_id": "x"}, force=False) as file:
        yield file


def sample(i=0, seq=1):
    values = dict.fromkeys(list(LIMNOLOGICAL)[:4], 10.0 + i)
    return Sample(
        time=NOON + timedelta(seconds=i),
        north_m=1.0 + i,
        east_m=2.0,
        target_seq=seq,
        speed_mps=1.5,
        values=values,
        flags=dict.fromkeys(values, Flag.GOOD),
    )


def point(i=0):
    return Step(
        elapsed_s=float(i),
        time=NOON + timedelta(seconds=i),
        state=(1.0 + i, 2.0, 0.1, 1.2, 0.0, 0.01),
        thrusts=(5.0, 6.0),
        target_seq=1,
        split_stage=4,
        solve_ms=1.5,
        status="solved",
    )


def test_the_plan_comes_back_as_it_was(survey_file):
    original, back = square_survey(), survey_file.survey
    assert back.vessel == original.vessel
    assert back.start.north_m == pytest.approx(original.start.north_m)
    for a, b in zip(original.targets, back.targets, strict=True):
        assert (a.seq, a.kind, a.set.speed_min_mps) == (b.seq, b.kind, b.set.speed_min_mps)
        assert a.set.polygon.symmetric_difference(b.set.polygon).area < 1e-4


def test_a_planned_file_has_empty_tables(survey_file):
    assert len(survey_file.samples()) == 0
    assert len(survey_file.track()) == 0


def test_a_second_writer_is_named(path, survey_file):
    with sqlite3.connect(path, timeout=0.1) as other:
        other.execute("BEGIN IMMEDIATE")
        survey_file._connection.execute("PRAGMA busy_timeout = 10")
        with pytest.raises(SurveyFileError, match="locked"):
            survey_file.append_samples([sample()])
        other.execute("ROLLBACK")


@pytest.mark.parametrize(
    "harm",
    [
        "DELETE FROM meta WHERE key = 'vessel'",
        "UPDATE meta SET value = '{' WHERE key = 'settings'",
        "DELETE FROM region",
        "UPDATE targets SET geom = NULL",
    ],
)
def test_a_file_whose_plan_is_broken_is_refused(path, survey_file, harm):
    survey_file.close()
    with sqlite3.connect(path) as connection:
        connection.execute(harm)
    connection.close()
    with pytest.raises(SurveyFileError, match=r"s\.gpkg is damaged"):
        SurveyFile.open(path)


def test_samples_and_track_come_back(survey_file):
    survey_file.append_samples([sample(i) for i in range(3)])
    survey_file.append_track(point())
    table, track = survey_file.samples(), survey_file.track()
    assert table.positions[2] == pytest.approx([3.0, 2.0], abs=1e-6)
    assert table.values["temperature_degc"].tolist() == [10.0, 11.0, 12.0]
    assert np.isnan(table.values["turbidity_ntu"]).all()
    assert set(table.flags["turbidity_ntu"].tolist()) == {Flag.MISSING}
    assert table.moment(1) == NOON + timedelta(seconds=1)
    assert track.states[0].tolist() == list(point().state)
    assert survey_file.progress().sample_counts[0] == 3


def test_gdal_reads_the_file_while_it_is_written(path, survey_file):
    """Each sample is visible to another program before the next one is taken."""
    for i in range(3):
        survey_file.append_samples([sample(i)])
        # This is another process, as another program would be: two SQLites in one share no locks.
        count = (
            "import pyogrio, sys;print(pyogrio.read_info(sys.argv[1], layer='samples')['features'])"
        )
        seen = subprocess.run(
            [sys.executable, "-c", count, str(path)], capture_output=True, text=True, check=True
        )
        assert int(seen.stdout) == i + 1
    survey_file.close()
    layers = {name for name, _ in pyogrio.list_layers(path)}
    plan = {"region", "targets", "cells", "corridors", "revisions", "sorties", "legs"}
    assert layers == plan | {"quantities", "track", "samples", "events", "meta"}
    _, _, geometry, _ = pyogrio.raw.read(path, layer="samples")
    lon, lat = shapely.from_wkb(geometry[0]).coords[0]
    assert survey_file.survey.frame.to_local((lon, lat)) == pytest.approx([1.0, 2.0], abs=1e-6)
    info = pyogrio.read_info(path, layer="targets")
    assert info["crs"] == "EPSG:4326"
    assert info["geometry_type"] == "Polygon"


def test_a_row_is_on_the_disk_when_the_call_returns(path, survey_file, tmp_path):
    """Copy the files as a power cut would leave them: the copy has every sample."""
    survey_file.append_samples([sample(i) for i in range(5)])
    for suffix in ("", "-wal"):
        shutil.copy(f"{path}{suffix}", tmp_path / f"copy.gpkg{suffix}")
    with SurveyFile.open(tmp_path / "copy.gpkg") as copy:
        assert len(copy.samples()) == 5


def test_reached_targets_stay_reached(survey_file):
    survey_file.mark_reached(1, NOON)
    survey_file.mark_reached(1, NOON + timedelta(hours=1))
    assert survey_file.progress().reached == 1
    assert survey_file.progress().reached_at[0] == NOON
    survey_file.clear_mission()
    assert survey_file.progress().reached == 0


def test_events_are_kept(survey_file):
    event = LogEntry(time=NOON, level="warning", code="step_unsolved", message="last plan")
    survey_file.append_event(event)
    assert survey_file.events() == [event]


def test_an_existing_file_is_left_alone_without_force(path, survey_file):
    before = path.read_bytes()
    with pytest.raises(SurveyFileError, match="by force"):
        SurveyFile.create(path, square_survey(), meta={}, force=False)
    assert path.read_bytes() == before


def test_a_file_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    with pytest.raises(SurveyFileError, match="cannot be written"):
        SurveyFile.create(tmp_path / "no" / "s.gpkg", square_survey(), meta={}, force=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("keep", [0, 10, 1000, 9000])
def test_a_cut_off_file_is_refused_and_not_touched(path, survey_file, keep):
    survey_file.append_samples([sample(i) for i in range(50)])
    survey_file.close()
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(SurveyFileError, match=r"s\.gpkg"):
        SurveyFile.open(path)
    assert path.stat().st_size == keep


def test_a_newer_schema_is_refused(path, survey_file):
    survey_file.close()
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(SurveyFileError, match="schema 99"):
        SurveyFile.open(path)


def test_other_databases_are_refused(tmp_path):
    path = tmp_path / "other.gpkg"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE t (x)")
    connection.close()
    with pytest.raises(SurveyFileError, match="not a survey file"):
        SurveyFile.open(path)


def test_a_full_disk_loses_nothing_that_was_recorded(path, survey_file):
    """SQLite's own limit stands in for the disk's."""
    survey_file.append_samples([sample()])
    connection = survey_file._connection
    pages = connection.execute("PRAGMA page_count").fetchone()[0]
    connection.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(SurveyFileError, match="kept"):
        _append_without_end(survey_file)
    kept = len(survey_file.samples())
    survey_file.close()
    with SurveyFile.open(path) as again:
        assert len(again.samples()) == kept > 0


def _append_without_end(survey_file):
    for i in range(5000):
        survey_file.append_samples([sample(i)])


def test_blobs_with_an_envelope_are_read():
    plain = geopackage.to_blob(shapely.Point(3, 50))
    assert geopackage.from_blob(plain) == shapely.Point(3, 50)
    with_envelope = plain[:3] + bytes([0b11]) + plain[4:8] + bytes(32) + plain[8:]
    assert geopackage.from_blob(with_envelope) == shapely.Point(3, 50)
    with pytest.raises(ValueError, match="GeoPackage"):
        geopackage.from_blob(b"junk")


def test_who_reads_in_the_missions_own_process_does_not_free_its_journal_for_others(
    path, survey_file
):
    """The system drops all locks of a process on a file as soon as any part of it closes the file.

    The next reader elsewhere would then assume that it is the last, and remove the live journal.
    """
    read = (
        "from pathlib import Path; from grebe.io.store import SurveyFile; "
        f"SurveyFile.open(Path({str(path)!r})).close()"
    )
    survey_file.begin_session(NOON)
    journal = path.with_name(path.name + "-wal")
    before = journal.stat().st_ino
    SurveyFile.open(path).close()
    subprocess.run([sys.executable, "-c", read], check=True)
    assert journal.stat().st_ino == before
    assert survey_file.stay_safe(NOON) == ""
