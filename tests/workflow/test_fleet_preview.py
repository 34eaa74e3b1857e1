"""The preview of a fleet: each boat's next sortie."""

from __future__ import annotations

import pytest
import shapely
from conftest import FRAME, NOON

from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.departure import prepare
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.workflow.files import write_survey
from grebe.workflow.preview import fleet_preview, preview_of


def test_a_fleets_preview_shows_every_boat_and_the_time_of_the_slowest(tmp_path):
    path = tmp_path / "f.gpkg"
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 60, 60))
    wanted = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=3, apart_m=6.0))
    planned = plan_fleet(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    with SurveyFile.open(path) as file:
        told = fleet_preview(file, NOON)
        each = [preview_of(prepare(file, NOON, sortie=one.number)) for one in file.revision.sorties]
        assert [line.split(":")[0] for line in told["boats"]] == ["1", "2", "3"]
        assert told["remaining_s"] == pytest.approx(max(one.remaining_s for one in each))
        assert told["targets"] == sum(one.targets for one in each)
        done = file.revision.sortie(2)
        for target in file.revision.targets[done.first - 1 : done.last]:
            file.mark_reached(target.seq, NOON)
        left = fleet_preview(file, NOON)["boats"]
        assert len(left) == 2
        assert not any(f"sortie {done.number}," in line for line in left)
