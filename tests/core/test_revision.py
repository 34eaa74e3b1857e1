"""A new order is made from an old one, and a target's number is never reused."""

from dataclasses import replace

import pytest
import shapely

from grebe.core.errors import InputError, UsageError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.revision import (
    Sortie,
    first_revision,
    left_out,
    numbered_on,
    revised,
    survey_of,
)
from grebe.core.sets import TargetSet
from grebe.core.survey import Pose, Survey, Target
from grebe.core.vessel import PRESETS

HERE = Pose(north_m=0.0, east_m=0.0)


def target(seq, north, kind="cell"):
    square = ((north, 0.0), (north + 1, 0.0), (north + 1, 1.0), (north, 1.0))
    one = TargetSet(vertices=square, speed_min_mps=0.5, speed_max_mps=1.0)
    return Target(seq=seq, kind=kind, set=one, cell=one.polygon if kind == "cell" else None)


def survey(count=4):
    return Survey(
        name="pond",
        frame=LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0),
        water=shapely.box(-10, -10, 20, 20),
        targets=tuple(target(seq, 2.0 * seq) for seq in range(1, count + 1)),
    )


def sortie(number, first, last):
    return Sortie(number=number, first=first, last=last, start=HERE, time_s=60.0, energy_wh=1.0)


def test_a_revision_changes_the_order_and_no_target():
    old = first_revision(survey())
    one, two, three, four = old.targets
    new = revised(old, reason="progress", note="", targets=[one, four, three, two])
    assert (new.number, new.highest_seq) == (2, 4)
    assert [t.seq for t in survey_of(survey(), new).targets] == [1, 4, 3, 2]
    assert {t.seq: t for t in new.targets} == {t.seq: t for t in old.targets}
    assert old.targets == (one, two, three, four)


def test_a_number_that_was_given_is_never_given_to_another_target():
    old = first_revision(survey())
    with pytest.raises(InputError, match="Target 2"):
        revised(old, reason="closed", note="", targets=[old.targets[0], target(2, 50.0)])
    shorter = revised(old, reason="closed", note="", targets=old.targets[:2])
    assert left_out(old, shorter) == (3, 4)
    (new,) = numbered_on(shorter, [target(1, 50.0, "transit")])
    assert new.seq == 5


def test_a_sortie_has_the_vessel_the_battery_and_the_minutes_of_its_boat():
    vessels = (PRESETS["spyboat"], PRESETS["otter"])
    settings = PlanSettings(
        sorties=SortieSettings(batteries_wh=(50.0, 300.0), minutes_each=(20.0, 40.0)),
        fleet=FleetSettings(boats=2, vessels=vessels),
    )
    whole = replace(survey(), settings=settings, vessel=vessels[0])
    plan = first_revision(whole, [sortie(1, 1, 2), replace(sortie(2, 3, 4), boat=2)])
    for one, vessel, bounds in zip(
        plan.sorties, vessels, ((50.0, 20.0), (300.0, 40.0)), strict=True
    ):
        part = survey_of(whole, plan, one)
        assert part.vessel == vessel
        assert (part.settings.sorties.battery_wh, part.settings.sorties.minutes) == bounds
    assert survey_of(whole, plan).settings == settings
    assert whole.whose(2) == "boat 2 (otter)"


def test_a_sortie_is_a_survey_of_its_own_with_the_numbers_of_the_whole():
    plan = first_revision(survey(), [sortie(1, 1, 1), sortie(2, 2, 4)])
    part = survey_of(survey(), plan, plan.sortie(2))
    assert [t.seq for t in part.targets] == [2, 3, 4]
    assert part.start == HERE
    with pytest.raises(UsageError, match="no sortie 3"):
        plan.sortie(3)


@pytest.mark.parametrize(
    "parts", [[(1, 1, 2), (2, 4, 4)], [(1, 1, 3)], [(1, 1, 2), (1, 3, 4)], [(1, 1, 5)]]
)
def test_sorties_hold_each_place_once(parts):
    with pytest.raises(InputError, match=r"[Ss]ortie"):
        first_revision(survey(), [sortie(*one) for one in parts])


def test_two_targets_do_not_share_a_number():
    with pytest.raises(InputError, match="number"):
        Survey(
            name="pond",
            frame=LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0),
            water=shapely.box(-10, -10, 20, 20),
            targets=(target(1, 0.0), target(1, 2.0)),
        )
