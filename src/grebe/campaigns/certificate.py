"""Confidence limits of the probability of success, from the successes of missions.

There are two lower limits. For a number of missions that was fixed beforehand, it is the exact
limit of Clopper and Pearson (Biometrika 26, 1934). For a campaign that is examined after each
mission and may stop at any time, it is a confidence sequence. With q mixed uniformly over (p, 1],
the likelihood ratio

    M_n(p) = int_p^1 q^s (1-q)^f dq / ((1-p) p^s (1-p)^f),   s successes, f failures, n = s + f,

is a supermartingale that begins at 1 if the true probability is p or less. By Ville's inequality
it then ever exceeds 1/alpha with a probability of at most alpha (Robbins, Ann. Math. Stat. 41,
1970). The limit after n missions is the largest p that has been refuted by then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import betainc, betaincinv, betaln, xlog1py, xlogy

from grebe.core.errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The limit is found to this accuracy, and then lowered by it to be on the safe side.
ACCURACY = 1e-9
# If the mixture's weight beyond p is less than this, the likeliest q are far below p, and there is
# no evidence.
TINY = 1e-280


class Verdict(StrEnum):
    """The verdict on a claim: certified with its confidence, refuted with the same, or neither."""

    CERTIFIED = "certified"
    REFUTED = "refuted"
    OPEN = "open"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim to decide: at least `share` of missions succeed, with `confidence`.

    Without a share nothing is decided, and the limit is that for a number of missions fixed
    beforehand.
    """

    confidence: float = 0.99
    share: float | None = None

    def __post_init__(self) -> None:
        if not 0.5 <= self.confidence < 1:
            raise UsageError(
                f"A confidence of {self.confidence:g} is not possible; give 0.5 to less than 1."
            )
        if self.share is not None and not 0 < self.share < 1:
            raise UsageError(
                f"A share of {self.share:g} cannot be claimed; give more than 0 and less than 1."
            )

    @property
    def alpha(self) -> float:
        """The greatest probability of a wrong limit."""
        return 1.0 - self.confidence


def clopper_pearson_lower(successes: int, missions: int, confidence: float) -> float:
    """Return the one-sided exact lower limit of a probability of success."""
    if successes == 0:
        return 0.0
    return float(betaincinv(successes, missions - successes + 1, 1.0 - confidence))


def clopper_pearson_upper(successes: int, missions: int, confidence: float) -> float:
    """Return the one-sided exact upper limit of a probability of success."""
    return 1.0 - clopper_pearson_lower(missions - successes, missions, confidence)


def log_evidence(successes: int, failures: int, share: float) -> float:
    """Return log M_n(share), the evidence against a probability of `share` or less."""
    a, b = successes + 1, failures + 1
    beyond = float(betainc(b, a, 1.0 - share))
    likelihood = float(xlogy(successes, share) + xlog1py(failures, -share))
    if beyond < TINY:
        return -math.inf
    return float(betaln(a, b)) + math.log(beyond) - math.log1p(-share) - likelihood


def refuted_below(successes: int, failures: int, alpha: float) -> float:
    """Return the largest p up to which every value is refuted by these counts alone."""
    if successes == 0:
        return 0.0
    best = successes / (successes + failures)
    bound = -math.log(alpha)

    def doubt(share: float) -> float:
        return log_evidence(successes, failures, share) - bound

    # The evidence falls as p grows from 0 to the observed share, and is less than 1 from there.
    low, high = 1e-12, min(best, 1.0 - 1e-12)
    if doubt(low) <= 0:
        return 0.0
    if doubt(high) > 0:
        return high
    root: Any = brentq(doubt, low, high, xtol=ACCURACY)
    return max(0.0, float(root) - ACCURACY)


def confidence_sequence(outcomes: Sequence[bool], alpha: float) -> NDArray[np.float64]:
    """Return the lower limit after each mission, (n,).

    All limits hold at once with a probability of at least 1 - alpha. They never fall: a value of p
    that has been refuted stays refuted.
    """
    limits = np.zeros(len(outcomes))
    successes, best = 0, 0.0
    for i, success in enumerate(outcomes):
        successes += success
        if success:  # a failure refutes no further p
            best = max(best, refuted_below(successes, i + 1 - successes, alpha))
        limits[i] = best
    return limits


class SequentialTest:
    """Takes outcomes one by one, in the order of the missions' numbers, and decides a claim.

    That order matters: otherwise missions that end early would count first, and those fail less.
    The claim is certified when the lower limit reaches the claimed share, and refuted when the
    upper limit, of the same kind and confidence, is below it.
    """

    def __init__(self, claim: Claim) -> None:
        self._claim = claim
        self._bound = -math.log(claim.alpha)
        self.successes = self.failures = 0
        self.verdict = Verdict.OPEN

    @property
    def missions(self) -> int:
        """The number of outcomes that count."""
        return self.successes + self.failures

    def count(self, *, success: bool) -> Verdict:
        """Take one outcome into account, unless the claim is decided; return the verdict."""
        share = self._claim.share
        if self.verdict is not Verdict.OPEN:
            return self.verdict
        self.successes += success
        self.failures += not success
        if share is None:
            return self.verdict
        if log_evidence(self.successes, self.failures, share) >= self._bound:
            self.verdict = Verdict.CERTIFIED
        elif log_evidence(self.failures, self.successes, 1.0 - share) >= self._bound:
            self.verdict = Verdict.REFUTED
        return self.verdict
