"""A survey file holds readings of one water, measured or simulated, and never of both.

All readings of a file make one map, and nothing in a map distinguishes them any more.
"""

from __future__ import annotations

from grebe.core.errors import SurveyFileError
from grebe.core.survey import is_simulated
from grebe.io.store import SurveyFile


def refuse_other_water(survey_file: SurveyFile, *, simulated: bool) -> None:
    """Raise `SurveyFileError` if a mission would add simulated readings to measured ones, or
    measured ones to simulated ones. A file that does not say which it holds may take either.
    """
    water = survey_file.meta().get("water", "")
    if not water or not survey_file.count("samples"):
        return
    held = is_simulated(water)
    if held and not simulated:
        raise SurveyFileError(
            f"{survey_file.path} holds readings of simulated water, and those of a real boat would "
            "make one map with them; start again by force, which discards the simulated mission, "
            "or sail another plan.",
            settings=("force",),
        )
    if simulated and not held:
        raise SurveyFileError(
            f"{survey_file.path} holds readings of real water, and those of a simulated boat would "
            "make one map with them; name the real boat, or rehearse on a copy of the plan that "
            "has not been sailed.",
            settings=("link",),
        )
