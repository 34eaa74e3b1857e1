"""The numbers printed for a plan in sorties or for several boats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from grebe.core.revision import Sortie
from grebe.planning.fleets.fleet_times import BoatTime, boat_times, fleet_s
from grebe.planning.planned import PlannedSorties
from grebe.workflow.plans import checked_sorties

if TYPE_CHECKING:
    from grebe.planning.sortie_check import SortieCheck


def sortie_numbers(
    planned: PlannedSorties, kept_as: Sequence[Sortie] | None = None
) -> dict[str, Any]:
    """Return the sorties, the time of each boat, and the result of an independent check. `kept_as`
    are the sorties as the file numbers them, if the plan follows an earlier one there.
    """
    numbers: dict[str, Any] = {
        "sorties": [
            f"{one.number}: {one.time_s / 60:.0f} min, {one.energy_wh:.0f} Wh{_whose(planned, one)}"
            for one in kept_as or planned.revision.sorties
        ]
    }
    if planned.survey.fleet is not None:
        numbers["duration_s"] = round(fleet_s(planned.revision), 1)
        numbers["boats"] = [_boat(planned, one) for one in boat_times(planned.revision)]
    over = round(planned.legs_s / planned.bound_s - 1, 4)
    settings = planned.survey.settings
    in_one_go = settings is not None and settings.sorties is None
    numbers["over_equal_share" if in_one_go else "over_bound"] = over
    return numbers | _proved(checked_sorties(planned))


def _proved(checks: Sequence[SortieCheck]) -> dict[str, Any]:
    """The result of the independent check of the sorties."""
    if not checks:
        return {}
    left_min = min(one.least_left_s for one in checks) / 60
    failed = [str(one.number) for one in checks if not one.holds]
    text = f"not proved for {', '.join(failed)}" if failed else "proved for every sortie"
    return {
        "home_in_time": f"{text}; at least {left_min:.1f} min to spare in addition to the reserve"
    }


def _boat(planned: PlannedSorties, one: BoatTime) -> str:
    """The prediction for one boat of a fleet, in words."""
    sailed = f"{one.under_way_s / 60:.0f} min under way, sorties: {one.sorties}"
    moved = f", changes of harbour: {one.moves}" if one.moves else ""
    return f"{planned.survey.whose(one.boat)}: {sailed}{moved}"


def _whose(planned: PlannedSorties, sortie: Sortie) -> str:
    whose = planned.survey.whose(sortie.boat)
    return f", {whose}" if whose else ""
