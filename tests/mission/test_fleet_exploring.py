"""Boats of a fleet extend their missions where it pays, each where the others will not measure."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME, NOON

from grebe.cli.main import grebe
from grebe.core.events import EndReason
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties
from grebe.simulation.faults import NO_FAULTS, Faults
from grebe.workflow.adaptive_run import Onward
from grebe.workflow.announced import announced
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld
from grebe.workflow.wish import Wish

KEY, APART_M = "temperature_degc", 6.0


def fleet_file(path, sorties=None):
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 90, 90))
    wanted = PlanSettings(
        cell_m=30.0,
        core=0.4,
        shore_margin_m=3.0,
        fleet=FleetSettings(boats=2, apart_m=APART_M),
        sorties=sorties,
    )
    make = plan_fleet if sorties is None else plan_sorties
    planned = make(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    return path


def explored(path, minutes=4.0, faults=None):
    """Sail both boats with extensions; return the report, and the least distance kept."""
    plants, least = {}, [np.inf]
    wish = Wish(quantity=KEY, minutes=minutes)

    def boat_at(boat, departure):
        of_boat = SimulatedWorld(boat=boat, faults=(faults or {}).get(boat, NO_FAULTS))
        link = of_boat(departure)
        plants[boat] = link._plant
        return link

    def hear(_):
        if len(plants) == 2:
            one, other = (np.array(plant.state[:2]) for plant in plants.values())
            least[0] = min(least[0], float(np.hypot(*(one - other))))

    with SurveyFile.open(path) as file:
        report = FleetRun(
            file,
            boat_at,
            steered_by(),
            watches=lambda _: [hear],
            extends=lambda sailing: Onward(path=path, wish=wish, sailing=sailing),
        ).run(NOON)
    return report, least[0]


def new_paths(path):
    """Each revision's boat, with the new part of its order as a line through the cells' centres."""
    with SurveyFile.open(path) as file:
        revisions = file.revisions()
    found = []
    for old, new in pairwise(revisions):
        known = {target.seq for target in old.targets}
        (whose,) = [
            one for one, was in zip(new.sorties, old.sorties, strict=True) if len(one) > len(was)
        ]
        places = [
            t.set.centre for t in new.targets[whose.first - 1 : whose.last] if t.seq not in known
        ]
        found.append((whose.boat, shapely.LineString(places)))
    return found


@pytest.mark.slow
def test_both_go_on_in_rounds_that_keep_to_different_water_and_it_is_the_same_twice(tmp_path):
    tracks = []
    for name in ("a", "b"):
        path = fleet_file(tmp_path / f"{name}.gpkg")
        report, least = explored(path)
        assert report.complete
        assert least >= APART_M
        with SurveyFile.open(path) as file:
            reasons = [one.reason for one in file.revisions()]
            tracks.append([one.states for one in file.track().each_boat()])
        assert reasons == ["planned", *["adaptive"] * (len(reasons) - 1)]
    for one, other in zip(*tracks, strict=True):
        assert np.array_equal(one, other)
    rounds = new_paths(path)
    assert sorted({boat for boat, _ in rounds}) == [1, 2]
    assert len(rounds) >= 4
    # Each boat plans next to what the other has just announced, not across it.
    for (boat, way), (other, before) in zip(rounds[1:], rounds, strict=False):
        if boat != other:
            assert way.intersection(before.buffer(4.0)).length < 0.3 * way.length


@pytest.mark.slow
def test_what_a_boat_had_gone_on_to_when_it_was_lost_nobody_takes_over(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg")
    report, _ = explored(path, faults={2: Faults(blind=((90.0, 1e9),))})
    ended = {boat: one.ended for boat, _, one in report.missions}
    assert ended == {1: EndReason.COMPLETE, 2: EndReason.BLIND}
    with SurveyFile.open(path) as file:
        assert {one.reason for one in file.revisions()} == {"planned", "adaptive"}
        own = file.revision.sorties[0]
        (other,) = file.revision.sorties[1:]
        assert file.progress().reached_in(other) < len(other)
        assert announced(file, file.revision, own, (1,)) == []
        assert len(announced(file, file.revision, own, (1, 2))) == 1


def test_what_others_have_left_is_what_they_have_announced(tmp_path):
    with SurveyFile.open(fleet_file(tmp_path / "f.gpkg")) as file:
        own, other = file.revision.sorties
        (way,) = announced(file, file.revision, own, (1, 2))
        rest = file.revision.targets[other.first - 1 : other.last]
        assert len(way) == 1 + len(rest)
        assert all(
            t.set.polygon.buffer(1e-6).covers(shapely.Point(p))
            for t, p in zip(rest, way[1:], strict=True)
        )
        file.mark_reached(rest[0].seq, NOON)
        (way,) = announced(file, file.revision, own, ())
        assert len(way) == len(rest)
        assert announced(file, file.revision, None, (1, 2)) == []


def test_boats_that_have_to_come_home_do_not_go_on(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg", sorties=SortieSettings(minutes=30.0))
    done = CliRunner().invoke(grebe, ["run", str(path), "--adaptive", KEY, "--more-minutes", "2"])
    assert "has them come home" in str(done.exception)
    with SurveyFile.open(path) as file:
        assert file.track_ends() is None
