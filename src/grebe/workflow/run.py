"""Run a survey: whoever steers, whatever boat, one way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime

from grebe.control.controller import Controller
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink
from grebe.mission.departure import Departure, prepare
from grebe.mission.helm import Helm
from grebe.mission.loop import Mission
from grebe.mission.recorders import Listener, SurveyRecorder
from grebe.mission.settings import MissionSettings
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
    on_ready: Callable[[Mission], None] | None = None,
) -> MissionReport:
    """Steer a boat through the targets of a survey file and record what it measures.

    `boat_at` opens the link and `helm_of` makes whoever steers, both once it is clear from where
    the mission sets out; `listeners` hear its events; `on_ready` is handed the mission before it
    begins, to stop it or call it home. A recorded mission is forgotten (`force`)
    only once all that the new one needs is there.
    Raises what `prepare` raises; a link that fails on the way is in the report, not raised.
    """
    departure = prepare(survey_file, now, resume=resume, force=force)
    survey_file.claim()
    helm = helm_of(departure)
    link = boat_at(departure)
    if departure.clears:
        survey_file.clear_mission()
    survey_file.set_meta("water", link.source)
    mission = Mission(
        departure.survey,
        helm,
        link,
        SurveyRecorder(survey_file),
        settings,
        quantities=departure.quantities,
        listeners=listeners,
        started=departure.started,
        reached=departure.reached,
        pilot=lambda way: helm_of(replace(departure, survey=way, reached=0)),
    )
    if on_ready is not None:
        on_ready(mission)
    return mission.run()
