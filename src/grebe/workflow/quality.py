"""Check the samples of a survey file; their flags are stored beside the values.

The values themselves stay as they were measured.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from grebe.core.quantities import Quantities
from grebe.io.store import SurveyFile
from grebe.mapping.quality import Quality, check_quality


def check_samples(survey_file: SurveyFile, quantities: Quantities | None = None) -> Quality:
    """Check all samples of a file and store their flags; the counts go to its meta table.

    `quantities` are those that the file declares, with other limits; None takes the file's.
    """
    samples = survey_file.samples()
    # A reading within two overlapping sets is recorded for each: it is checked once.
    rows = np.column_stack([samples.times, samples.positions, *samples.values.values()])
    _, once, back = np.unique(rows, axis=0, return_index=True, return_inverse=True, equal_nan=True)
    kept = np.sort(once)
    back = np.searchsorted(kept, once[back.ravel()])
    known = survey_file.quantities if quantities is None else quantities
    quality = check_quality(samples.rows(kept), survey_file.survey.water, known)
    quality = replace(quality, flags={key: one[back] for key, one in quality.flags.items()})
    survey_file.set_flags(quality.flags)
    survey_file.set_meta(
        "quality", json.dumps({"counts": quality.counts, "notes": list(quality.notes)})
    )
    return quality
