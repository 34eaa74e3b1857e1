"""A long mission: its use of memory and disk does not grow with its length."""

import sqlite3
import tracemalloc
from contextlib import closing

import pytest
from conftest import NOON

from grebe.control.controller import Command, StepStatus
from grebe.core.errors import LinkError
from grebe.core.events import EndReason
from grebe.core.frames import LocalFrame
from grebe.core.sets import rectangle
from grebe.core.survey import Pose, Survey, Target
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import BoatStatus, Observation
from grebe.mission.events.recorders import SurveyRecorder
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings

FAR = rectangle((1e5, 1e5 + 10), (0, 10), (1.0, 2.0))
SURVEY = Survey(
    name="far",
    frame=LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0),
    water=FAR.polygon,
    targets=(Target(seq=1, kind="cell", set=FAR, cell=FAR.polygon),),
    vessel=PRESETS["spyboat"],
    start=Pose(north_m=0.0, east_m=0.0),
)
# A page of SQLite in its journal, with its header [bytes].
FRAME = 4096 + 24


class Restless:
    """A helm that steps at every estimate, with another command each time."""

    vessel = PRESETS["spyboat"]
    step_s = 0.1
    reached = 0

    def __init__(self):
        self._n = 0

    def step(self, state, weather, elapsed_s):
        self._n += 1
        thrusts = (float(self._n % 7), 1.0)
        return Command(thrusts=thrusts, plan=None, status=StepStatus.SOLVED, target=0, split=0)


class Drifting:
    """A boat that never arrives; `look` is called after every `every` estimates."""

    source = "drifting"

    def __init__(self, estimates, every, look):
        self._left, self._every, self._look, self._n = estimates, every, look, 0

    def observe(self):
        self._n += 1
        if self._n > self._left:
            raise LinkError("that was all")
        if self._n % self._every == 0:
            self._look()
        return Observation(time_s=0.1 * self._n, state=(0.01 * self._n, 0.0, 0.0, 1.5, 0.0, 0.0))

    def command(self, order):
        pass

    def measure(self):
        return {"ph": 7.0}

    def status(self):
        return BoatStatus(mode="drifting", armed=True)

    def stop(self):
        pass

    def close(self):
        pass


@pytest.mark.slow
def test_memory_and_journal_are_bounded_while_others_read(tmp_path):
    """Ten minutes at 10 Hz, with a row of the track at each estimate, and a reader now and then."""
    path = tmp_path / "s.gpkg"
    memory, journal, seen = [], [], []
    with SurveyFile.create(path, SURVEY, meta={}, force=True) as file:
        reader = sqlite3.connect(f"file:{path}?mode=ro", uri=True, isolation_level=None)

        def look():
            memory.append(tracemalloc.get_traced_memory()[0])
            journal.append(path.with_name("s.gpkg-wal").stat().st_size)
            # The reader keeps its snapshot until the next look; neither side hinders the other.
            if reader.in_transaction:
                reader.execute("COMMIT")
            else:
                reader.execute("BEGIN")
                seen.append(reader.execute("SELECT count(*) FROM track").fetchone()[0])

        link = Drifting(6000, 500, look)
        settings = MissionSettings(observes=False)
        tracemalloc.start()
        with closing(reader):
            report = Mission(SURVEY, Restless(), link, SurveyRecorder(file), settings).run()
        tracemalloc.stop()
        assert report.ended is EndReason.LINK_LOST
        assert report.steps == 6000
        assert file.count("track") == 6000
        assert file.count("samples") == 600
    assert all(n >= 1000 * i - 502 for i, n in enumerate(seen, 1))
    # Eight bytes a step are kept, for the median of all; nothing else may accumulate.
    assert max(memory[2:]) - memory[1] < 200_000
    # The time of the reader's visits may make a difference of a page or two.
    assert max(journal[6:]) <= max(journal[:6]) + 2 * FRAME


def test_no_write_of_a_mission_looks_through_a_table(tmp_path):
    """Every statement finds its rows by a key, so writes do not slow down as tables grow."""
    with SurveyFile.create(tmp_path / "s.gpkg", SURVEY, meta={}, force=True) as file:
        said = []
        file._connection.set_trace_callback(said.append)
        helm, link = Restless(), Drifting(3, 10, None)
        Mission(SURVEY, helm, link, SurveyRecorder(file), started=NOON).run()
        file.mark_reached(1, NOON)
        file._connection.set_trace_callback(None)
        writes = [sql for sql in said if sql.split()[0] in {"INSERT", "UPDATE", "DELETE"}]
        assert len(writes) > 5
        for sql in writes:
            plan = file._connection.execute(f"EXPLAIN QUERY PLAN {sql}").fetchall()
            assert not any("SCAN" in row[3] for row in plan), sql
        ends = "SELECT time FROM track WHERE fid = (SELECT max(fid) FROM track)"
        plan = file._connection.execute(f"EXPLAIN QUERY PLAN {ends}").fetchall()
        assert not any(row[3].startswith("SCAN track") for row in plan)
