"""The samples of a survey file, checked: flags and sensor lags are stored beside the values.

The values themselves stay as they were measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.lag import Lag, unlagged
from grebe.mapping.quality import DEFAULT_LIMITS, Limits, Quality, Record, check_quality
from grebe.store import SampleTable, SurveyFile

if TYPE_CHECKING:
    from numpy.typing import NDArray


def check_samples(
    survey_file: SurveyFile, limits: Mapping[str, Limits] = DEFAULT_LIMITS
) -> Quality:
    """Check all samples of a file and store their flags; the counts go to its meta table."""
    table = survey_file.samples()
    seconds = np.array([moment.timestamp() for moment in table.times])
    # A reading within two overlapping sets is recorded for each: it is checked once.
    _, once, back = np.unique(seconds, return_index=True, return_inverse=True)
    rising = np.all(np.diff(seconds) >= 0)
    keep, back = (once, back.ravel()) if rising else (np.arange(len(seconds)),) * 2
    record = Record(
        times=seconds[keep],
        lonlat=survey_file.survey.frame.to_wgs84(table.positions[keep]),
        positions=table.positions[keep],
        values={key: column[keep] for key, column in table.values.items()},
    )
    quality = check_quality(record, survey_file.survey.water, limits)
    survey_file.set_flags({key: flags[back] for key, flags in quality.flags.items()})
    survey_file.set_meta(
        "quality", json.dumps({"counts": quality.counts, "notes": list(quality.notes)})
    )
    return quality


def store_lags(survey_file: SurveyFile, lags: Mapping[str, Lag]) -> None:
    """Note the lag of each sensor, for the maps."""
    survey_file.set_meta("lags", json.dumps({key: asdict(lag) for key, lag in lags.items()}))


def stored_lags(survey_file: SurveyFile) -> dict[str, Lag]:
    """The lags noted in a file."""
    noted = json.loads(survey_file.meta().get("lags", "{}"))
    return {key: Lag(**one) for key, one in noted.items()}


def corrected_values(table: SampleTable, lags: Mapping[str, Lag]) -> dict[str, NDArray[np.float64]]:
    """The values without the sensors' lag; those that are not good teach the others nothing."""
    seconds = np.array([moment.timestamp() for moment in table.times])
    order = np.argsort(seconds, kind="stable")
    corrected = dict(table.values)
    for key, lag in lags.items():
        column = np.where(table.flags[key][order] == 1, table.values[key][order], np.nan)
        times, once = np.unique(seconds[order], return_index=True)
        column = np.interp(
            seconds, times, unlagged(times, column[once], lag), left=np.nan, right=np.nan
        )
        corrected[key] = np.where(np.isfinite(table.values[key]), column, np.nan)
    return corrected
