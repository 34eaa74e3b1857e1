"""Run a campaign: sail the missions that are missing, and stop when the claim is decided.

Results count in the order of the missions' numbers, not as they arrive: missions that end early
arrive first, and fail less. The verdict, and the mission after which it is reached, are therefore
the same with any engine, and however often the campaign was interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

from grebe.campaigns.certificate import (
    SequentialTest,
    Verdict,
    clopper_pearson_lower,
    confidence_sequence,
)
from grebe.campaigns.engine import Engine
from grebe.campaigns.results import Results
from grebe.campaigns.settings import Campaign
from grebe.campaigns.task import Scene, Summary
from grebe.core.errors import PlanError
from grebe.core.survey import Survey


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of a campaign: the `missions` that count, by their numbers from 0, the verdict,
    and the lower confidence limit of the probability of success.

    Missions that workers were sailing when the claim was decided are stored, but do not count.
    """

    campaign: Campaign
    survey: Survey
    missions: tuple[Summary, ...]
    verdict: Verdict
    limit: float

    @property
    def successes(self) -> int:
        """The number of missions that succeeded."""
        return sum(one.success for one in self.missions)

    @property
    def is_sequential(self) -> bool:
        """Whether the campaign could stop early; its limit is then from a confidence sequence."""
        return self.campaign.claim.share is not None


def run_campaign(
    campaign: Campaign,
    survey: Survey,
    results: Results,
    engine: Engine,
    watch: Callable[[int, int], None] = lambda _done, _of: None,
) -> Outcome:
    """Sail a campaign to its verdict or its last mission.

    `watch` is called with the number of missions done and the number of all. Raises `PlanError`
    when the survey is not planned.
    """
    if survey.vessel is None or survey.start is None or not survey.targets:
        raise PlanError("The survey has no targets to steer to; plan a survey first.")
    counted, test = list[Summary](), SequentialTest(campaign.claim)

    def count_next() -> bool:
        """Count the results of the next numbers; return whether no more are needed."""
        while test.verdict is Verdict.OPEN and len(counted) < campaign.missions:
            one = results.known.get(len(counted))
            if one is None:
                return False
            counted.append(one)
            test.count(success=one.success)
        return True

    missing = (i for i in range(campaign.missions) if i not in results.known)
    if not count_next():
        _sail(Scene(campaign=campaign, survey=survey), missing, results, engine, count_next, watch)
    return Outcome(
        campaign=campaign,
        survey=survey,
        missions=tuple(counted),
        verdict=test.verdict,
        limit=_limit(campaign, [one.success for one in counted]),
    )


def _sail(
    scene: Scene,
    missing: Iterator[int],
    results: Results,
    engine: Engine,
    count_next: Callable[[], bool],
    watch: Callable[[int, int], None],
) -> None:
    """Sail missions until `count_next` needs no more; results are stored whatever ends the loop."""
    try:
        with closing(engine.results(scene, missing)) as summaries:
            for _, summary in summaries:
                results.keep(summary)
                watch(len(results.known), scene.campaign.missions)
                if count_next():
                    break
    finally:
        results.flush()


def _limit(campaign: Campaign, outcomes: list[bool]) -> float:
    """The lower limit: for a fixed number of missions, or one that is valid wherever it stopped."""
    if campaign.claim.share is None:
        return clopper_pearson_lower(sum(outcomes), len(outcomes), campaign.claim.confidence)
    return float(confidence_sequence(outcomes, campaign.claim.alpha)[-1])
