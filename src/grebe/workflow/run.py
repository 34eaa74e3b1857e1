"""Run a survey: whoever steers, whatever boat, one way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime

from grebe.control.controller import Controller
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, ModelledLink
from grebe.mission.departure import Departure, prepare
from grebe.mission.loop import Helm, Mission, MissionSettings
from grebe.mission.recorders import Listener, SurveyRecorder
from grebe.mission.statistics import MissionReport

BoatAt = Callable[[Departure], BoatLink]
HelmOf = Callable[[Departure], Helm]


def steered_by(rule: Rule | None = None, solver: SolverBuilder | None = None) -> HelmOf:
    """Return what makes Grebe's controller, with a rule and a solver, for a survey."""

    def helm(departure: Departure) -> Helm:
        survey = departure.survey
        return Controller(
            departure.vessel, survey.sets, rule, corridors=survey.corridors, solver=solver
        )

    return helm


def run_survey(
    survey_file: SurveyFile,
    boat_at: BoatAt,
    helm_of: HelmOf,
    now: datetime,
    settings: MissionSettings | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    listeners: Sequence[Listener] = (),
) -> MissionReport:
    """Steer a boat through the targets of a survey file and record what it measures.

    `boat_at` opens the link and `helm_of` makes whoever steers, once it is clear from where the
    mission sets out and what the link knows of the boat; `listeners` hear its events. A recorded
    mission is forgotten (`force`) only once all that the new one needs is there.
    Raises what `prepare` raises; a link that fails on the way is in the report, not raised.
    """
    departure = prepare(survey_file, now, resume=resume, force=force)
    survey_file.claim()
    link = boat_at(departure)
    try:
        mission = Mission(
            departure.survey,
            helm_of(_as_known_to(link, departure)),
            link,
            SurveyRecorder(survey_file),
            settings,
            quantities=departure.quantities,
            listeners=listeners,
            started=departure.started,
            reached=departure.reached,
        )
        if departure.clears:
            survey_file.clear_mission()
        survey_file.set_meta("water", link.source)
    except BaseException:
        link.close()
        raise
    return mission.run()


def _as_known_to(link: BoatLink, departure: Departure) -> Departure:
    """The departure with the boat as its link knows it."""
    return replace(departure, vessel=link.model) if isinstance(link, ModelledLink) else departure
