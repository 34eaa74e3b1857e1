"""The samples of a survey file, checked: flags and sensor lags are stored beside the values.

The values themselves stay as they were measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.samples import Flag
from grebe.io.store import SampleTable, SurveyFile
from grebe.mapping.lag import Lag, unlagged
from grebe.mapping.quality import DEFAULT_LIMITS, Limits, Quality, Record, check_quality

if TYPE_CHECKING:
    from numpy.typing import NDArray


def check_samples(
    survey_file: SurveyFile, limits: Mapping[str, Limits] = DEFAULT_LIMITS
) -> Quality:
    """Check all samples of a file and store their flags; the counts go to its meta table."""
    table = survey_file.samples()
    seconds = np.array([moment.timestamp() for moment in table.times])
    # A reading within two overlapping sets is recorded for each: it is checked once.
    rows = np.column_stack([seconds, table.positions, *table.values.values()])
    _, once, back = np.unique(rows, axis=0, return_index=True, return_inverse=True, equal_nan=True)
    kept = np.sort(once)
    back = np.searchsorted(kept, once[back.ravel()])
    record = Record(
        times=seconds[kept],
        lonlat=survey_file.survey.frame.to_wgs84(table.positions[kept]),
        positions=table.positions[kept],
        values={key: column[kept] for key, column in table.values.items()},
    )
    quality = check_quality(record, survey_file.survey.water, limits)
    quality = replace(quality, flags={key: one[back] for key, one in quality.flags.items()})
    survey_file.set_flags(quality.flags)
    survey_file.set_meta(
        "quality", json.dumps({"counts": quality.counts, "notes": list(quality.notes)})
    )
    return quality


def store_lags(survey_file: SurveyFile, lags: Mapping[str, Lag]) -> None:
    """Note the lag of some sensors, for the maps, beside those noted before; no lag forgets one."""
    known = stored_lags(survey_file) | dict(lags)
    kept = {key: asdict(lag) for key, lag in known.items() if lag != Lag()}
    survey_file.set_meta("lags", json.dumps(kept))


def stored_lags(survey_file: SurveyFile) -> dict[str, Lag]:
    """The lags noted in a file."""
    noted = json.loads(survey_file.meta().get("lags", "{}"))
    return {key: Lag(**one) for key, one in noted.items()}


def corrected_values(table: SampleTable, lags: Mapping[str, Lag]) -> dict[str, NDArray[np.float64]]:
    """The values without the sensors' lag; those that are not good teach the others nothing."""
    seconds = np.array([moment.timestamp() for moment in table.times])
    corrected = dict(table.values)
    for key, lag in lags.items():
        good = np.flatnonzero(np.isin(table.flags[key], Flag.USABLE))
        good = good[np.argsort(seconds[good], kind="stable")]
        times, once, back = np.unique(seconds[good], return_index=True, return_inverse=True)
        column = np.full(len(seconds), np.nan)
        column[good] = unlagged(times, table.values[key][good[once]], lag)[back]
        corrected[key] = column
    return corrected
