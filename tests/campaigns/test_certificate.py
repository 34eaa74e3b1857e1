"""The certificate: published limits, the supermartingale, and its exact coverage."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from grebe.campaigns.certificate import (
    Claim,
    SequentialTest,
    Verdict,
    clopper_pearson_lower,
    clopper_pearson_upper,
    confidence_sequence,
    log_evidence,
    refuted_below,
)
from grebe.core.errors import UsageError

ALPHA = 0.05


@pytest.mark.parametrize(
    ("successes", "missions"), [(0, 5), (1, 1), (17, 20), (299, 299), (950, 1000)]
)
@pytest.mark.parametrize("confidence", [0.9, 0.99])
def test_clopper_and_pearson_s_limits_are_scipy_s(successes, missions, confidence):
    for side, limit in (("greater", clopper_pearson_lower), ("less", clopper_pearson_upper)):
        exact = binomtest(successes, missions, alternative=side).proportion_ci(confidence, "exact")
        published = exact.low if side == "greater" else exact.high
        assert limit(successes, missions, confidence) == pytest.approx(published, abs=1e-9)


def test_without_failures_the_limit_is_the_root_of_alpha():
    """Wilks (1941): 299 without a failure show 99 % with 95 % confidence, 59 show 95 %."""
    assert clopper_pearson_lower(299, 299, 0.95) >= 0.99 > clopper_pearson_lower(298, 298, 0.95)
    assert clopper_pearson_lower(59, 59, 0.95) >= 0.95 > clopper_pearson_lower(58, 58, 0.95)


def test_the_evidence_is_the_mixture_s_integral():
    q = np.linspace(0.8, 1.0, 200_001)
    ratio = (q / 0.8) ** 17 * ((1 - q) / 0.2) ** 3
    assert log_evidence(17, 3, 0.8) == pytest.approx(
        math.log(np.trapezoid(ratio, q) / 0.2), abs=1e-6
    )


@pytest.mark.parametrize("truth", [0.5, 0.8, 0.9])
def test_the_evidence_against_what_is_true_does_not_grow_on_average(truth):
    """E M_(n+1) = M_n if the true probability is p itself, and no more if it is less."""
    for successes, failures in ((0, 0), (3, 1), (40, 2), (10, 10)):
        for less in (0.0, 0.1):
            p = truth - less
            now = math.exp(log_evidence(successes, failures, truth))
            after = p * math.exp(log_evidence(successes + 1, failures, truth)) + (1 - p) * math.exp(
                log_evidence(successes, failures + 1, truth)
            )
            assert after <= now * (1 + 1e-9)
            if not less:
                assert after == pytest.approx(now)


def ever_wrong(truth: float, missions: int) -> float:
    """The exact probability that the evidence ever refutes the truth: all paths of successes are
    followed at once, and those that cross the bound are taken out.
    """
    alive, wrong = np.array([1.0]), 0.0
    for n in range(1, missions + 1):
        alive = np.append(alive * (1 - truth), 0.0) + np.insert(alive * truth, 0, 0.0)
        for s in np.flatnonzero(alive):
            if log_evidence(int(s), n - int(s), truth) >= -math.log(ALPHA):
                wrong += alive[s]
                alive[s] = 0.0
    return wrong


@pytest.mark.parametrize("truth", [0.6, 0.9, 0.97])
def test_checked_after_every_mission_it_errs_as_rarely_as_stated(truth):
    wrong = ever_wrong(truth, 250)
    assert 0.2 * ALPHA < wrong <= ALPHA  # it errs at times, or the test would show nothing


def test_clopper_and_pearson_looked_at_after_every_mission_would_err_more_often():
    """This is why a campaign that stops early has another limit."""
    random = np.random.default_rng(3)
    wins = np.cumsum(random.uniform(size=(2000, 250)) < 0.9, axis=1)
    counts = np.arange(1, 251)
    from scipy.special import betaincinv

    limits = betaincinv(wins, counts - wins + 1, ALPHA, where=wins > 0, out=np.zeros(wins.shape))
    assert np.mean((limits > 0.9).any(axis=1)) > 2 * ALPHA


def test_simulated_campaigns_are_certified_falsely_as_rarely_as_is_said():
    random = np.random.default_rng(4)
    claim = Claim(confidence=1 - ALPHA, share=0.9)

    def verdict(truth):
        test = SequentialTest(claim)
        for success in random.uniform(size=300) < truth:
            if test.count(success=bool(success)) is not Verdict.OPEN:
                break
        return test.verdict

    at_the_edge = [verdict(0.9) for _ in range(400)]
    two_sd = 2 * math.sqrt(ALPHA * (1 - ALPHA) / 400)
    assert np.mean([one is Verdict.CERTIFIED for one in at_the_edge]) <= ALPHA + two_sd
    assert np.mean([one is Verdict.REFUTED for one in at_the_edge]) <= ALPHA + two_sd
    assert np.mean([verdict(0.99) is Verdict.CERTIFIED for _ in range(100)]) > 0.9
    assert np.mean([verdict(0.7) is Verdict.REFUTED for _ in range(100)]) > 0.9


def test_a_certified_share_is_no_higher_than_the_limit():
    claim, outcomes = Claim(confidence=0.99, share=0.95), []
    test = SequentialTest(claim)
    while test.verdict is Verdict.OPEN:
        outcomes.append(len(outcomes) % 60 != 7)
        test.count(success=outcomes[-1])
    assert test.verdict is Verdict.CERTIFIED
    limits = confidence_sequence(outcomes, claim.alpha)
    assert limits[-1] >= claim.share > limits[-2]
    assert np.all(np.diff(limits) >= 0)


def test_the_limit_is_where_the_evidence_reaches_its_bound():
    limit = refuted_below(180, 4, 0.01)
    assert log_evidence(180, 4, limit) == pytest.approx(-math.log(0.01), abs=1e-4)
    assert refuted_below(0, 10, 0.01) == 0.0
    assert refuted_below(1, 0, 0.01) < 0.01


@pytest.mark.parametrize("wrong", [{"confidence": 1.0}, {"confidence": 0.3}, {"share": 1.0}])
def test_what_cannot_be_claimed_is_refused(wrong):
    with pytest.raises(UsageError):
        Claim(**wrong)
