"""Run a survey with any helm and any boat link."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime

from grebe.control.controller import Controller
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.core.events import Warned
from grebe.core.survey import Survey, is_simulated
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Instruments, as_driven
from grebe.links.simulated import SimulatedLink
from grebe.mission.consumption import Consumption
from grebe.mission.departure import Departure, prepare
from grebe.mission.events.broadcast import Broadcast
from grebe.mission.events.recorders import Listener, SurveyRecorder
from grebe.mission.events.statistics import MissionReport
from grebe.mission.helm import Helm
from grebe.mission.loop import Mission
from grebe.mission.replanning import Extension, Replanner, SharedPlan
from grebe.mission.safety.route_home import Pilot, check_home
from grebe.mission.safety.watchdog import guarded, journal_beside, taken_notes
from grebe.mission.settings import MissionSettings
from grebe.workflow.garbage_collection import no_long_pauses
from grebe.workflow.one_water import refuse_other_water

BoatAt = Callable[[Departure], BoatLink]
HelmOf = Callable[[Departure], Helm]


def steered_by(rule: Rule | None = None, solver: SolverBuilder | None = None) -> HelmOf:
    """Return a factory of helms for a departure: Grebe's controller with a rule and a solver."""

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
    sortie: int | None = None,
    replans: bool = False,
    extends: Extension | None = None,
    listeners: Sequence[Listener] = (),
    on_ready: Callable[[Mission], None] | None = None,
    instruments: Instruments | None = None,
) -> MissionReport:
    """Steer a boat through the targets of a survey file and record what it measures.

    A plan in sorties sails the one that `sortie` names, by default the first that is not done. With
    `replans` the rest is replanned when a target is out of reach, the current has changed or the
    sortie is late; a closed area always does that. `extends` says where it goes on after its order.

    `boat_at` opens the link and `helm_of` makes the helm, once the start and the link's knowledge
    of the boat are known. `listeners` receive the events; `on_ready` gets the mission before it
    begins, to stop it or call it home. `instruments` are sondes apart from the boat, which the
    caller closes; the file declares their quantities. `force` discards a recorded mission only once
    all that the new one needs is there. Raises what `prepare` and `refuse_other_water` raise; a
    link that fails on the way is in the report instead.
    """
    departure = prepare(survey_file, now, resume=resume, force=force, sortie=sortie)
    departure = spent_as_said(departure, settings)
    if settings is not None:
        check_home(departure.survey, settings.safety)
    survey_file.claim()
    link = boat_at(departure)
    try:
        known = as_known_to(link, departure)
        helm, pilot = helm_of(known), pilot_of(known, helm_of)
        with guarded(link, journal_beside(survey_file.path)) as guards, no_long_pauses():
            _begin(survey_file, departure, link.source, now, listeners)
            mission = Mission(
                departure.survey,
                helm,
                link,
                SurveyRecorder(survey_file, _whose(survey_file, departure)),
                counting(settings, departure),
                quantities=departure.quantities,
                listeners=[*guards, *listeners],
                started=departure.started,
                reached=departure.reached,
                pilot=pilot,
                replanner=_replanner(survey_file, known, pilot, link, replans, extends),
                instruments=instruments,
            )
            if on_ready is not None:
                on_ready(mission)
            return mission.run()
    except BaseException:
        link.close()
        raise


def _begin(
    survey_file: SurveyFile,
    departure: Departure,
    source: str,
    now: datetime,
    listeners: Sequence[Listener],
) -> None:
    """Note in the file that a mission sets out, and say what must be known before it."""
    if departure.clears:
        survey_file.clear_mission()
    refuse_other_water(survey_file, simulated=is_simulated(source))
    survey_file.set_meta("water", source)
    survey_file.begin_session(now)
    say_first(departure, survey_file, listeners)


def _whose(survey_file: SurveyFile, departure: Departure) -> int | None:
    """Return the number of the boat that sails, if it is one of a fleet."""
    fleet, sortie = survey_file.survey.fleet, departure.sortie
    return None if fleet is None or sortie is None else sortie.boat


def as_known_to(link: BoatLink, departure: Departure) -> Departure:
    """Return the departure with the boat as its link knows it."""
    model = as_driven(link).model
    return departure if model is None else replace(departure, vessel=model)


def pilot_of(departure: Departure, helm_of: HelmOf) -> Pilot:
    """Return a factory of helms for other routes: the way home, or a new order."""

    def pilot(route: Survey) -> Helm:
        return helm_of(replace(departure, survey=route, reached=0))

    return pilot


def _replanner(
    survey_file: SurveyFile,
    departure: Departure,
    pilot: Pilot,
    link: BoatLink,
    reacts: bool,
    extends: Extension | None,
) -> Replanner:
    """Return the replanner of the mission.

    A simulated boat, whose time is not the clock's, waits for it.
    """
    return Replanner(
        survey=survey_file.survey,
        plan=SharedPlan(revision=survey_file.revision),
        vessel=departure.vessel,
        helm_of=pilot,
        sortie=None if departure.sortie is None else departure.sortie.number,
        spent_s=departure.spent.seconds,
        waits=isinstance(link, SimulatedLink),
        reacts=reacts,
        extends=extends,
    )


def spent_as_said(departure: Departure, settings: MissionSettings | None) -> Departure:
    """Return the departure with the energy that the battery has given, if the settings state it.

    This is another battery than that of the track, and so it also has its full time ahead.
    """
    used_wh = None if settings is None else settings.safety.used_wh
    return (
        departure if used_wh is None else replace(departure, spent=Consumption(energy_wh=used_wh))
    )


def counting(settings: MissionSettings | None, departure: Departure) -> MissionSettings:
    """Return settings with the energy that the battery had given before, unless they state it."""
    settings = settings or MissionSettings()
    if settings.safety.used_wh is not None:
        return settings
    return replace(settings, safety=replace(settings.safety, used_wh=departure.spent.energy_wh))


def say_first(departure: Departure, survey_file: SurveyFile, listeners: Sequence[Listener]) -> None:
    """Report what must be known before a mission: doubts, and what a watchdog had to do earlier."""
    broadcast = Broadcast(SurveyRecorder(survey_file), listeners)
    said = [(doubt.code, doubt.message) for doubt in departure.doubts]
    said += [("watchdog_acted", note) for note in taken_notes(journal_beside(survey_file.path))]
    for code, message in said:
        broadcast.hold(Warned(time=departure.started, elapsed_s=0.0, code=code, message=message))
    broadcast.close()
