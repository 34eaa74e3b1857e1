"""A survey that was sailed is followed by another one, in the same file: a pure function.

What was planned and sailed stays in front as it was. The second survey's targets are numbered on,
and each of its trips is a sortie more, of whichever boat; where the first was one mission, that
becomes the first sortie.
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

    `settings` are those that hold from then on: of the boats, of what their sorties may take, and
    of their harbours.
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
    """What was sailed as one mission, as the first sortie."""
    if survey.start is None or survey.outcome is None:
        raise PlanError("Only a planned survey can be followed by another; plan it first.")
    return Sortie(
        number=1, first=1, last=len(old.targets), start=survey.start,
        time_s=survey.outcome.time_s, energy_wh=survey.outcome.energy_wh,
    )  # fmt: skip
