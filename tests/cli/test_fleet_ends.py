"""The output of grebe run after a fleet has sailed: who waits ashore, and what to do next."""

import pytest

from grebe.cli.fleet_run import explain, next_command
from grebe.core.errors import IncompleteError
from grebe.core.events import EndReason
from grebe.mission.events.statistics import MissionReport
from grebe.workflow.fleets import FleetReport


def report(*, reached, ashore=(), ends=(EndReason.COMPLETE, EndReason.COMPLETE)):
    def mission(ended):
        return MissionReport(
            reached=5, targets=5, steps=1, duration_s=1.0, path_m=1.0, energy_wh=1.0,
            unsolved_steps=0, step_ms_median=1.0, step_ms_p95=1.0, samples=1, samples_in_sets=1,
            ended=ended, message="",
        )  # fmt: skip

    missions = tuple((boat, boat, mission(ended)) for boat, ended in enumerate(ends, 1))
    return FleetReport(missions=missions, reached=reached, targets=20, ashore=ashore)


def test_boats_that_wait_ashore_after_their_sorties_are_no_failure(capsys):
    waits = report(reached=10, ashore=(1, 2))
    explain(waits, "f.gpkg")
    assert "boat 1 and 2" in capsys.readouterr().err
    assert next_command(waits, "f.gpkg") == "grebe run f.gpkg --resume"


def test_missed_targets_and_boats_that_wait_ashore_are_reported(
    capsys,
):
    missed = report(reached=7, ashore=(1,), ends=(EndReason.CAME_HOME, EndReason.COMPLETE))
    with pytest.raises(IncompleteError, match="13 of 20"):
        explain(missed, "f.gpkg")
    assert "boat 1;" in capsys.readouterr().err


def test_a_fleet_that_has_done_all_goes_on_to_its_maps(capsys):
    done = report(reached=20)
    explain(done, "f.gpkg")
    assert capsys.readouterr().err == ""
    assert next_command(done, "f.gpkg") == "grebe map f.gpkg --out maps"
