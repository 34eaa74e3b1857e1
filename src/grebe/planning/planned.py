"""The planner's results: a survey, the outcome of its settings, and the result of a check."""

from __future__ import annotations

from dataclasses import dataclass

from grebe.core.plan_settings import PlanOutcome
from grebe.core.revision import PlanRevision
from grebe.core.survey import Survey
from grebe.planning.check import PlanCheck


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A survey, the outcome of its settings, the result of an independent check, and notes for
    the user.
    """

    survey: Survey
    outcome: PlanOutcome
    check: PlanCheck
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class PlannedSorties(Planned):
    """A survey in sorties, which `revision` holds.

    `bound_s` is a lower bound of the time of all sorties together, and `legs_s` the time of these
    trips through the cells' centres, in the same measure. For unlike boats both refer to the
    cells as they are shared out. For a fleet without sorties, `legs_s` is the time of the slowest
    boat, and `bound_s` the time of one boat alone over the number of boats.
    """

    revision: PlanRevision
    bound_s: float
    legs_s: float
