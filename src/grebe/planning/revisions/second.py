"""Append a second survey to one that was sailed, in the same file: a pure function.

The plan of the first survey stays unchanged, in front. The targets of the second are numbered
consecutively after it, and each of its trips is one more sortie, of any boat. If the first survey
was one mission, that becomes the first sortie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.core.revision import PlanRevision, Sortie, numbered_on, revised
from grebe.core.survey import Survey


def followed_by(
    old: PlanRevision,
    survey: Survey,
    second: PlanRevision,
    *,
    settings: PlanSettings,
    note: str,
) -> PlanRevision:
    """Return the revision of a survey's plan in which the sorties of a second plan follow its own.

    `settings` apply from then on: to the boats, the limits of their sorties, and their harbours.
    Raises `PlanError` when the first survey was never planned.
    """
    targets = [*old.targets, *numbered_on(old, second.targets)]
    both = bool(old.corridors) and bool(second.corridors)
    sailed = list(old.sorties) or [_one_mission(old, survey)]
    highest, places = max(one.number for one in sailed), len(old.targets)
    more = [
        replace(
            one, number=highest + i, first=one.first + places, last=one.last + places
        )
        for i, one in enumerate(second.sorties, 1)
    ]  # fmt: skip
    return revised(
        old,
        reason="adaptive",
        note=note,
        targets=targets,
        corridors=[*old.corridors, *second.corridors] if both else [],
        sorties=_in_turn([*sailed, *more]),
        settings=settings,
    )


def _in_turn(sorties: Sequence[Sortie]) -> list[Sortie]:
    return sorted(sorties, key=lambda one: one.first)


def _one_mission(old: PlanRevision, survey: Survey) -> Sortie:
    """The first survey, which was one mission, as the first sortie."""
    if survey.start is None or survey.outcome is None:
        raise PlanError("Only a planned survey can be followed by another; plan it first.")
    return Sortie(
        number=1, first=1, last=len(old.targets), start=survey.start,
        time_s=survey.outcome.time_s, energy_wh=survey.outcome.energy_wh,
    )  # fmt: skip
