"""The method that best predicts left-out readings, and a calibration of its standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from grebe.mapping.methods.base import Domain, Field, Method, Model, Readings
from grebe.mapping.proof.calibration import Calibration, for_few, spread
from grebe.mapping.proof.unrest import calmed, unrest_of
from grebe.mapping.proof.validation import STRETCH_M, Validation, predicted, prove, stretch_folds
from grebe.mapping.scale import LINEAR, Scale
from grebe.mapping.way import half_cell_m

# More readings than these are thinned for validation: along a path they are closer together than
# the left-out pieces are wide, and more of them show the same.
MOST_FOR_PROOF = 1_000
CHOSEN = "this one predicts left-out samples better"


@dataclass(frozen=True, kw_only=True)
class Best:
    """The method that predicts best, its field and model, and how far they can be trusted."""

    method: Method
    field: Field
    model: Model
    calibration: Calibration
    validation: Validation | None


def best_of(
    methods: Sequence[Method], readings: Readings, domain: Domain, scale: Scale = LINEAR
) -> Best:
    """Fit each method and return the one that best predicts what is left out: stretches of the path
    of two lengths, and whole lines. If nothing can be left out, return the first.
    """
    tried = [_tried(one, readings, domain, scale) for one in methods]
    scores = [score for score, _ in tried]
    chosen = int(np.argmin(scores))
    best = tried[chosen][1]
    if max(scores) > scores[chosen]:
        ways = {2: "two", 3: "three"}.get(len(tried), str(len(tried)))
        text = f"{best.model.reason}; of the {ways} ways to fit, {CHOSEN}"
        return replace(best, model=replace(best.model, reason=text))
    return best


def _tried(method: Method, readings: Readings, domain: Domain, scale: Scale) -> tuple[float, Best]:
    """A fitted method, and the geometric mean of its errors at several distances."""
    found = method.fit(readings, domain)
    way = readings.positions
    readings = readings.part(np.arange(len(readings)) % _every(len(readings)) == 0)
    proof = prove(readings, found, scale=scale)
    if proof is None:
        return np.inf, Best(
            method=method, field=found, model=found.model, calibration=Calibration(),
            validation=None,
        )  # fmt: skip
    positions = readings.positions
    near = [predicted(readings, found, stretch_folds(positions, side)) for side in STRETCH_M]
    validation, far = proof
    unrest = unrest_of(near)
    stretches = [int(np.ptp(positions, axis=0).sum() / side) + 1 for side in STRETCH_M]
    on_way = [
        spread(calmed(one, unrest), count) for one, count in zip(near, stretches, strict=True)
    ]
    lines = spread(calmed(far, unrest), validation.pieces) * for_few(validation.pieces)
    calibration = Calibration(
        on_way=float(np.exp(np.mean(np.log(on_way)))),
        # There is less evidence off the path: the model's standard deviation is never reduced
        # there.
        off_way=max(lines, 1.0),
        way=way,
        wide_m=half_cell_m(domain.grid.step_m),
        unrest=unrest,
    )
    told = [max(one.rmse, 1e-300) for one in (*near, far) if len(one.error)]
    score = float(np.mean(np.log(told))) if told else np.inf
    return score, Best(
        method=method,
        field=found,
        model=found.model,
        calibration=calibration,
        validation=validation,
    )


def _every(count: int) -> int:
    """The step by which `count` readings are thinned for validation."""
    return -(-count // MOST_FOR_PROOF)
