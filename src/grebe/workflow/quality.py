"""Check the samples of a survey file, and store flags beside the values.

The values themselves stay as they were measured.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import shapely

from grebe.core.quantities import Quantities
from grebe.core.samples import Samples
from grebe.io.store import SurveyFile
from grebe.mapping.quality.control import Quality, check_quality


def check_samples(survey_file: SurveyFile, quantities: Quantities | None = None) -> Quality:
    """Check all samples of a file and store their flags; the counts go to its meta table.

    `quantities` are those that the file declares, with other limits; None uses the file's.
    """
    known = survey_file.quantities if quantities is None else quantities
    quality = judged(survey_file.samples(), survey_file.survey.water, known)
    survey_file.set_flags(quality.flags)
    survey_file.set_meta(
        "quality", json.dumps({"counts": quality.counts, "notes": list(quality.notes)})
    )
    return quality


def judged(samples: Samples, water: shapely.Polygon, known: Quantities) -> Quality:
    """Return the quality of all samples of a survey; nothing is stored."""
    # A reading within two overlapping sets is recorded for each, but is checked once.
    rows = np.column_stack([samples.times, samples.positions, *samples.values.values()])
    _, once, back = np.unique(rows, axis=0, return_index=True, return_inverse=True, equal_nan=True)
    kept = np.sort(once)
    back = np.searchsorted(kept, once[back.ravel()])
    quality = _checked(samples.rows(kept), water, known)
    return replace(quality, flags={key: one[back] for key, one in quality.flags.items()})


def _checked(samples: Samples, water: shapely.Polygon, known: Quantities) -> Quality:
    """Return the quality of samples, each boat's judged separately.

    Consecutive readings of two boats say nothing about either.
    """
    each = samples.each_boat()
    if len(each) == 1:
        return check_quality(samples, water, known)
    flags = {key: np.empty(len(samples), dtype=np.int64) for key in samples.values}
    counts: dict[str, dict[str, tuple[int, int]]] = {}
    notes: list[str] = []
    for number, places in enumerate(each, 1):
        found = check_quality(samples.rows(places), water, known)
        for key, column in found.flags.items():
            flags[key][places] = column
        for key, tests in found.counts.items():
            for test, (suspect, failed) in tests.items():
                before = counts.setdefault(key, {}).get(test, (0, 0))
                counts[key][test] = (before[0] + suspect, before[1] + failed)
        notes += [f"boat {number}: {note}" for note in found.notes]
    return Quality(flags=flags, counts=counts, notes=tuple(notes))
