"""Boats of a fleet replan their parts, each its own, in one plan that all share."""

from __future__ import annotations

import threading
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from conftest import FRAME, NOON

from grebe.core.dynamics import Weather
from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.revision import revised
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.replanning import SharedPlan
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.workflow.closures import Closures
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

SIDE = 70.0
OTHER = Weather(current_north_mps=0.25, current_east_mps=0.1)


def fleet_file(path):
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, SIDE, SIDE))
    wanted = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=2, apart_m=6.0))
    planned = plan_fleet(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    return path


def sailed(path, zone_file=None, world=None, **options):
    """Sail both boats in an unplanned current; return the report and the revisions."""
    world = world or SimulatedWorld(weather=OTHER)
    with SurveyFile.open(path) as file:
        said, closing = [], {}
        if zone_file is not None:
            made = {"path": zone_file, "survey": file.survey, "say": said.append}
            closing = {boat: Closures(**made) for boat in (1, 2)}
        report = FleetRun(
            file,
            lambda boat, departure: replace(world, boat=boat)(departure),
            steered_by(),
            watches=lambda boat: [closing[boat]] if closing else [],
            on_ready=lambda boat, mission: closing[boat].begin(mission) if closing else None,
            **options,
        ).run(NOON)
        return report, file.revisions(), file.track(), file.revision


@pytest.mark.slow
def test_each_boat_replans_its_own_part_only(tmp_path, monkeypatch):
    monkeypatch.setattr("grebe.mission.replanning.FOR_S", 15.0)
    tracks = []
    for name in ("a", "b"):
        path = fleet_file(tmp_path / f"{name}.gpkg")
        report, revisions, track, _ = sailed(path, replans=True)
        assert report.complete
        reasons = [one.reason for one in revisions]
        assert reasons.count("weather") >= 2
        assert [one.number for one in revisions] == list(range(1, len(revisions) + 1))
        for old, new in pairwise(revisions):
            same = [one.number for one in old.sorties if part(old, one) == part(new, one)]
            # One boat gets another order, and the other keeps its own.
            assert len(same) >= 1
        tracks.append([one.states for one in track.each_boat()])
    for one, other in zip(*tracks, strict=True):
        assert np.array_equal(one, other)


def part(revision, sortie):
    """The numbers of the targets that a sortie visits, in order."""
    own = revision.sortie(sortie.number)
    return [target.seq for target in revision.targets[own.first - 1 : own.last]]


@pytest.mark.slow
def test_an_area_is_closed_to_all_boats(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg")
    zone = shapely.box(0, 45, 22, 68)
    corners = FRAME.to_wgs84(np.array(zone.exterior.coords)).tolist()
    where = tmp_path / "closed.geojson"
    where.write_text(shapely.to_geojson(shapely.Polygon(corners)))
    report, revisions, track, last = sailed(path, where, SimulatedWorld())
    assert report.complete
    assert [one.reason for one in revisions[1:]] == ["closed"] * (len(revisions) - 1)
    kept = [t.set.polygon for t in last.targets if t.kind == "cell"]
    assert not any(one.intersection(zone).area > 1e-6 for one in kept)
    for one in track.each_boat():
        assert not shapely.contains_xy(zone, one.states[:, :2]).any()


def test_of_two_revisions_of_one_plan_the_second_is_computed_again(tmp_path):
    with SurveyFile.open(fleet_file(tmp_path / "f.gpkg")) as file:
        kept = []
        plan = SharedPlan(revision=file.revision, keep=kept.append)
        old = file.revision
        made = [
            revised(
                old, reason="weather", note=str(i), targets=old.targets, corridors=old.corridors,
                sorties=old.sorties,
            )
            for i in range(8)
        ]  # fmt: skip
    taken = []
    threads = [
        threading.Thread(target=lambda one=one: taken.append(plan.take(one))) for one in made
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == [False] * 7 + [True]
    assert [one.number for one in kept] == [2]
    assert plan.revision is kept[0]
