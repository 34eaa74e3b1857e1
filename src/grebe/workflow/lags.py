"""Estimate the sensors' lag from two runs of one line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities
from grebe.core.samples import Samples
from grebe.io.store import SurveyFile
from grebe.mapping.lag import LagEstimate, Pass, estimate_lag

if TYPE_CHECKING:
    from numpy.typing import NDArray

LONGEST_APART_S = 6 * 3600.0


def compare_runs(first: Path, second: Path) -> tuple[dict[str, LagEstimate], Quantities]:
    """Return the lag of each common quantity that brings the runs of two surveys closest.

    Also returns the quantities by their keys. Raises `InputError` if the runs are too far apart, in
    time or in place.
    """
    with SurveyFile.open(first) as one, SurveyFile.open(second) as other:
        frame, quantities = one.survey.frame, one.quantities
        runs = one.samples(), other.samples()
        elsewhere = frame.to_local(other.survey.frame.to_wgs84(runs[1].positions))
    runs = runs[0], runs[1].moved(elsewhere)
    apart_s = abs(float(np.median(runs[0].times) - np.median(runs[1].times)))
    if apart_s > LONGEST_APART_S:
        raise InputError(
            f"{first} and {second} were measured {apart_s / 3600:.0f} h apart: the water itself "
            "has changed since; a lag needs two runs of one line within hours."
        )
    found: dict[str, LagEstimate] = {}
    for key in runs[0].values:
        passes = [_pass(run, key) for run in runs]
        if min(len(run.times) for run in passes) == 0:
            continue
        try:
            found[key] = estimate_lag(*passes)
        except ValueError as error:
            raise InputError(f"{first} and {second}: {error}.") from None
    if not found:
        raise InputError(f"{first} and {second} have no quantity in common.")
    return found, quantities


def _pass(run: Samples, key: str) -> Pass:
    good: NDArray[np.bool_] = run.usable(key) if key in run.values else np.zeros(len(run), bool)
    values = run.values.get(key, np.full(len(run), np.nan))
    return Pass(times=run.times[good], positions=run.positions[good], values=values[good])
