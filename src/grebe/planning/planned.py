"""What a planner hands back: a survey, what came of its settings, and what a check found."""

from __future__ import annotations

from dataclasses import dataclass

from grebe.core.plan_settings import PlanOutcome
from grebe.core.revision import PlanRevision
from grebe.core.survey import Survey
from grebe.planning.check import PlanCheck


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A survey, what the planner made of its settings, what an independent check found, and
    what whoever asked for it should know.
    """

    survey: Survey
    outcome: PlanOutcome
    check: PlanCheck
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class PlannedSorties(Planned):
    """A survey in sorties; `revision` holds them, `bound_s` is what no sorties together go below,
    `legs_s` what the trips through the cells' centres take in the same measure; of unlike boats
    both are of the cells as they are shared out. Of a fleet without
    sorties `legs_s` is what the slowest boat takes, `bound_s` one boat's time over their number.
    """

    revision: PlanRevision
    bound_s: float
    legs_s: float
