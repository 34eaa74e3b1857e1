"""The state of a fleet that a page receives: each boat by itself, and all as one survey."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
import shapely
from conftest import FRAME, NOON

from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.server import views
from grebe.server.fleet_state import together
from grebe.server.live import MissionWatch
from grebe.server.mission_delta import MissionDelta
from grebe.server.mission_socket import MissionSocket
from grebe.server.tabs import Lease
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld


class Heard(MissionSocket):
    """The socket of a fleet's missions, which stores every message."""

    def open(self, with_status):
        self.told = []
        self._server_socket.close()

    def _send(self, told):
        self.told.append(json.loads(json.dumps(told, allow_nan=False)))


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    """The survey file of two boats, the snapshot before their missions, and the messages since."""
    path = tmp_path_factory.mktemp("fleet") / "f.gpkg"
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 50, 50))
    wanted = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=2, apart_m=6.0))
    planned = plan_fleet(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    before = views.snapshot("x", path)
    with SurveyFile.open(path) as file:
        deltas = {boat: MissionDelta(file.survey, list(file.quantities)) for boat in (1, 2)}
        mission_socket = Heard(deltas, of_fleet=True)
        mission_socket.open(path)

        def watches(boat):
            return [
                lambda event: mission_socket.on_event(event, boat),
                lambda _: mission_socket._send_once(),
            ]

        world = SimulatedWorld()
        report = FleetRun(
            file,
            lambda boat, departure: mission_socket.with_status(replace(world, boat=boat))(
                departure
            ),
            steered_by(),
            watches=watches,
        ).run(NOON)
    assert report.complete
    return path, before, mission_socket.told


def watched(path, state, told):
    watch = MissionWatch("x", path, Lease())
    watch.state = state
    said = []
    watch._send = lambda kind, what: said.append((kind, json.loads(json.dumps(what))))
    watch._send_map = lambda: None
    for one in told:
        watch._apply(one)
    return watch, [what for kind, what in said if kind == "delta"]


def test_what_the_boats_publish_is_what_their_file_holds(sailed):
    path, before, told = sailed
    watch, said = watched(path, before, told)
    after = views.snapshot("x", path)
    status = watch.state["status"]
    for name in ("state", "reached", "targets", "samples", "coverage"):
        assert status[name] == after["status"][name], name
    assert status["state"] == "complete"
    assert {one["boat"] for one in said} == {1, 2}
    for heard, kept in zip(watch.state["boats"], after["boats"], strict=True):
        assert heard["status"]["reached"] == kept["status"]["reached"] == kept["status"]["targets"]
        assert len(heard["samples"]) == len(kept["samples"]) > 0
        assert heard["estimate"]["lat"] == pytest.approx(kept["estimate"]["lat"], abs=1e-5)
        assert len(heard["track"]) > 10
    shown = watch.snapshot("tab")
    assert [one["boat"] for one in shown["boats"]] == [1, 2]
    assert shown["track"] == shown["samples"] == []
    assert shown["boats"][1]["track"][0][0] < 2.0


def test_a_page_that_looks_on_late_counts_nothing_of_a_boat_twice(sailed):
    path, _, told = sailed
    watch, _ = watched(path, views.snapshot("x", path), told[-40:])
    after = views.snapshot("x", path)
    assert watch.state["status"]["samples"] == after["status"]["samples"]
    assert watch.state["status"]["reached"] == after["status"]["reached"]


def test_a_fleet_is_under_way_while_one_of_its_boats_is():
    one = {"status": {"state": "complete", "doing": "mission_complete", "eta_s": None}}
    other = {"status": {"state": "running", "doing": "surveying", "eta_s": 30.0}}
    unheard = {"status": {"reached": 0, "targets": 4}}
    assert together([one, other, unheard])["state"] == "running"
    assert together([one, other])["eta_s"] == 30.0
    assert together([one, one])["state"] == "complete"
    assert together([one, {"status": {"state": "interrupted"}}])["state"] == "interrupted"


def test_an_order_goes_to_every_boat():
    class Mission:
        def __init__(self):
            self.asked = []

        def hold_station(self, why):
            self.asked.append(("hold", why))

        go_on = come_home = stop = None

    mission_socket, missions = (
        MissionSocket({1: None, 2: None}, of_fleet=True),
        {1: Mission(), 2: Mission()},
    )
    mission_socket._server_socket.close()
    for boat, mission in missions.items():
        mission_socket.attach(mission, boat)
    mission_socket._execute("pause")
    mission_socket._execute("nonsense")
    assert all(len(mission.asked) == 1 for mission in missions.values())
