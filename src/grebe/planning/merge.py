"""Join surveys of parts of a lake into one survey, in which each part is a sortie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import shapely

from grebe.core.plan_settings import PlanOutcome
from grebe.core.revision import PlanRevision, Sortie, first_revision, survey_of
from grebe.core.survey import Survey, Target, covered_share, overlap_m2
from grebe.planning.check import PlanCheck, check_plan


def merged(
    parts: Sequence[Survey], bound_m: float, boats: Sequence[int] = ()
) -> tuple[Survey, PlanRevision]:
    """Return one survey made of several, and its plan in which each of them is a sortie.

    Targets are numbered consecutively. `boats` are the numbers of the boats that sail the parts;
    without them boat 1 sails all.
    """
    targets: list[Target] = []
    sorties: list[Sortie] = []
    for number, part in enumerate(parts, 1):
        outcome, start = part.outcome, part.start
        assert outcome is not None
        assert start is not None
        first = len(targets) + 1
        targets += [replace(t, seq=i) for i, t in enumerate(part.targets, first)]
        sorties.append(
            Sortie(
                number=number, first=first, last=len(targets), start=start,
                time_s=outcome.time_s, energy_wh=outcome.energy_wh,
                boat=boats[number - 1] if boats else 1,
            )
        )  # fmt: skip
    survey = replace(
        parts[0],
        targets=tuple(targets),
        corridors=tuple(one for part in parts for one in part.corridors),
        outcome=_outcome(parts, bound_m),
    )
    return survey, first_revision(survey, sorties)


def _outcome(parts: Sequence[Survey], bound_m: float) -> PlanOutcome:
    each = [part.outcome for part in parts if part.outcome is not None]
    length = sum(one.length_m for one in each)
    return replace(
        each[0],
        length_m=length,
        turns=sum(one.turns for one in each),
        time_s=sum(one.time_s for one in each),
        energy_wh=sum(one.energy_wh for one in each),
        lower_bound_m=bound_m,
        gap=length / bound_m - 1 if bound_m > 0 else 0.0,
    )


def checked(survey: Survey, revision: PlanRevision, water: shapely.Polygon) -> PlanCheck:
    """The combined check of all sorties: nothing is checked between them, where no boat sails."""
    checks = [check_plan(survey_of(survey, revision, one), water) for one in revision.sorties]
    cells = survey.cells
    overlap = overlap_m2(cells)
    return PlanCheck(
        outside_m2=sum(one.outside_m2 for one in checks),
        coverage=covered_share(cells, water, overlap),
        overlap_m2=overlap,
        start_afloat=all(one.start_afloat for one in checks),
    )
