"""grebe run: steer a boat through every target set of a survey."""

from __future__ import annotations

import json
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn

import click
from click.core import ParameterSource

from grebe.cli import options, output
from grebe.cli.adaptive_options import adaptive_options, onward_of, wish_of
from grebe.cli.fleet_run import explain, fleet_numbers, next_command, run_fleet
from grebe.cli.interruption import handle_signals_for, ignore_hangup
from grebe.cli.live_view import live_view
from grebe.cli.rule_options import refuse_foreign, rule_of, rule_options
from grebe.cli.run_preview import say_spent, say_which, show_preview
from grebe.cli.safety_options import ONCE, boats_changed, safety_of, safety_options
from grebe.cli.world_options import world_of, world_options
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.core.errors import IncompleteError, LinkError, StoppedError, UsageError
from grebe.core.events import EndReason
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.survey import Survey
from grebe.io.readers.quantities import user_quantities
from grebe.io.store import SurveyFile
from grebe.links.instruments.instrument import InstrumentSet
from grebe.mission.consumption import NOTHING, Consumption
from grebe.mission.departure import prepare
from grebe.mission.events.statistics import Alarm, MissionReport, ProgressMeter
from grebe.mission.loop import Mission
from grebe.mission.measuring.sampling import InSets, InWindow
from grebe.mission.settings import MissionSettings
from grebe.workflow.boats import SIMULATED, Harbour, boat_named, simulates
from grebe.workflow.closures import Closures
from grebe.workflow.instruments import (
    boat_and_instrument,
    declare_quantities,
    instrument_named,
    instruments_at,
    of_fleet,
    of_one_boat,
    refuse_unopened,
)
from grebe.workflow.one_water import refuse_other_water
from grebe.workflow.quality import check_samples
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld
from grebe.workflow.sorties import kept_by_plan, sortie_states


@click.command(name="run")
@click.argument("file", type=options.EXISTING)
@click.option(
    "--link",
    "urls",
    multiple=True,
    default=(SIMULATED,),
    help="The boat: sim: is simulated, mavlink:udp:HOST:PORT (or tcp:, serial:) has an autopilot, "
    "nmea:udp:HOST:PORT?out=udp:HOST:PORT (or nmea:serial:DEVICE@BAUD) speaks NMEA, "
    "replay:FILE[?speed=10|max] replays a recorded mission, python:FILE.py is a link of your own. "
    "For a fleet, once for each boat.  [default: sim:]",
)
@rule_options
@world_options
@click.option(
    "--sample-in-sets-only",
    "in_sets_only",
    is_flag=True,
    help="Keep only the readings within target sets, as in the paper.  "
    "[default: every second within the speed window]",
)
@click.option(
    "--instrument",
    "instruments",
    multiple=True,
    metavar="ADDRESS@PROFILE",
    help="A sonde that is not read through the boat's link, such as serial:/dev/ttyUSB0@ysi-exo; "
    "for a boat of a fleet, with its number: 2=ADDRESS@PROFILE. May be repeated; grebe instruments "
    "lists the profiles.",
)
@safety_options
@options.quantities_option
@click.option(
    "--sortie",
    type=click.IntRange(min=1),
    help="Number of the sortie to sail, if the plan has several.  [default: the first that is not "
    "done]",
)
@click.option(
    "--replan",
    "replans",
    is_flag=True,
    help="Plan the rest anew, while the boat sails, if a target is not reached in time (it is left "
    "out), if the current differs from the planned one, or if a sortie is late (its last targets "
    "are moved to a sortie of their own).",
)
@click.option(
    "--closed",
    type=click.Path(dir_okay=False, resolve_path=True),
    metavar="FILE",
    help="Keep out of the areas in this file of polygons, as for --no-go. It is read again when it "
    "changes while the boat sails; closed parts of the plan are left out, and the rest is planned "
    "anew.",
)
@adaptive_options
@click.option("--live", is_flag=True, help="Show the mission in the app, and print its address.")
@click.option("--yes", is_flag=True, help="Arm a real boat without asking, for scripts.")
@click.option("--resume", is_flag=True, help="Continue where the recorded mission ended.")
@click.option("--preview", is_flag=True, help="Print what would be done, and do nothing.")
@options.force_option
@options.json_option
@click.pass_context
def command(
    ctx: click.Context,
    file: Path,
    urls: tuple[str, ...],
    instruments: tuple[str, ...],
    sortie: int | None,
    resume: bool,
    preview: bool,
    live: bool,
    force: bool,
    as_json: bool,
    **run: Any,
) -> None:
    """Steer the boat through every target set of FILE and record what it measures.

    With --resume, options that are not given keep their values from the resumed run. Closing the
    terminal does not end the mission; Ctrl-C and SIGTERM do.
    """
    now, goes_on = datetime.now(UTC), _goes_on(resume=resume or run["returns"], force=force)
    urls = _links(ctx, file, urls, sortie) if goes_on else urls
    _judge(urls, instruments, run, now)
    if preview:
        show_preview(file, sortie, urls, run, now, resume=goes_on, force=force, as_json=as_json)
        return
    ignore_hangup()
    own = user_quantities(run.pop("quantities_file"), file)
    with (
        _claimed(file, instruments, sortie) as survey_file,
        instruments_at(instruments, BUILTIN.extended(own)) as instrument_sets,
        output.MissionBar(quiet=as_json) as bar,
    ):
        refuse_unopened(instrument_sets.values())
        _declare(survey_file, own, instrument_sets)
        run = _as_before(ctx, run, survey_file.meta().get("run", "{}") if goes_on else "{}")
        run["fresh"] = _typed(ctx, "battery_wh")
        fleet = survey_file.survey.fleet if sortie is None else None
        run["changed"] = boats_changed(run.pop("battery_changed"), fleet.boats if fleet else 1)
        before = survey_file.progress().reached if goes_on else 0
        _keep(run, survey_file)
        _keep_links(urls, survey_file, sortie)
        if fleet is not None:
            _sail_fleet(
                survey_file, urls, run, now, bar, instrument_sets, live,
                resume=resume, force=force, as_json=as_json,
            )  # fmt: skip
            return
        report = _run(
            survey_file, _only(urls), run, now, bar, live,
            resume=goes_on, force=force, sortie=sortie, instruments=of_one_boat(instrument_sets),
        )  # fmt: skip
        file, ahead = survey_file.path, _what_follows(survey_file)
        moved = survey_file.count("track") > 0 and report.reached > before
    came_home = run["returns"] and report.ended is EndReason.CAME_HOME
    # If targets are left, _explain says what to do next.
    over = report.complete or came_home
    output.result(report.numbers(), as_json=as_json, next_command=ahead if over else "")
    if not report.complete and not came_home:
        _explain(report, file, moved=moved)


def _goes_on(*, resume: bool, force: bool) -> bool:
    if resume and force:
        raise UsageError(
            "--resume and --return continue a mission, --force starts again; give one of them."
        )
    return resume


def _what_follows(survey_file: SurveyFile) -> str:
    """The next command: another run if sorties are left, else the map."""
    path = output.quoted(survey_file.path)
    left = [one for one in sortie_states(survey_file) if not one.is_flown]
    return f"grebe run {path}" if left else f"grebe map {path} --out maps"


def _keep(run: dict[str, Any], survey_file: SurveyFile) -> None:
    """Store the options of a run for the one that resumes it."""
    kept = {name: value for name, value in run.items() if name not in (*ONCE, "fresh", "changed")}
    survey_file.set_meta("run", json.dumps(kept, default=str))
    if run["closed"] is not None and not Path(run["closed"]).exists():
        output.note(f"{run['closed']} does not exist yet; it is looked for while the boat sails")


def _keep_links(urls: tuple[str, ...], survey_file: SurveyFile, sortie: int | None) -> None:
    """Store the links for the run that resumes it, unless other sorties have other boats."""
    if survey_file.survey.fleet is None or sortie is None:
        survey_file.set_meta("links", json.dumps(urls))


def _links(
    ctx: click.Context, file: Path, given: tuple[str, ...], sortie: int | None
) -> tuple[str, ...]:
    """The links given for a run that continues another, or those of the recorded run."""
    if _typed(ctx, "urls"):
        return given
    with SurveyFile.open(file) as survey_file:
        if survey_file.survey.fleet is not None and sortie is not None:
            return given
        urls = tuple(json.loads(survey_file.meta().get("links", "null")) or given)
    real = [url for url in urls if url != SIMULATED]
    if real:
        output.note(f"the boat is {', '.join(real)}, as before")
    return urls


@contextmanager
def _claimed(file: Path, instruments: tuple[str, ...], sortie: int | None) -> Generator[SurveyFile]:
    """Claim a survey file for writing, then compile the controller. Compiling takes half a minute
    and comes last, so that a file already in use, or an instrument that names no valid boat, is
    reported at once.
    """
    with SurveyFile.open(file) as survey_file:
        fleet = survey_file.survey.fleet if sortie is None else None
        whose = {boat_and_instrument(one)[0]: one for one in instruments}
        if fleet is None:
            of_one_boat(whose)
        else:
            of_fleet(whose, fleet.boats)
        survey_file.claim()
        output.compile_once()
        yield survey_file


def _judge(
    urls: tuple[str, ...], instruments: tuple[str, ...], run: dict[str, Any], now: datetime
) -> None:
    """Check the options before the file is opened."""
    for url in urls:
        boat_named(url)
    safety_of(run, now)
    if wish_of(run) is not None and run["closed"] is not None:
        raise UsageError("--adaptive does not respect closed areas; leave out --closed.")
    _settings(run)
    for one in instruments:
        instrument_named(boat_and_instrument(one)[1])


def _declare(
    survey_file: SurveyFile, own: Quantities, instrument_sets: Mapping[int | None, InstrumentSet]
) -> None:
    """Add a column to the file for each quantity that will be measured."""
    if own:
        survey_file.claim()
        survey_file.declare(own)
    for instrument_set in instrument_sets.values():
        survey_file.claim()
        declare_quantities(survey_file, instrument_set, BUILTIN.extended(own))


def _run(
    survey_file: SurveyFile,
    url: str,
    run: dict[str, Any],
    now: datetime,
    bar: output.MissionBar,
    live: bool,
    **how: Any,
) -> MissionReport:
    """Sail with the options `run`, and check the quality of the samples."""
    rule, solver, world = _settings(run)
    departure = prepare(
        survey_file, now, resume=how["resume"], force=how["force"], sortie=how["sortie"]
    )
    if (simulated := simulates(url)) is not None and not departure.clears:
        # The run itself refuses it too, but only when a real boat is armed.
        refuse_other_water(survey_file, simulated=simulated)
    say_which(departure, survey_file)
    if not (run["fresh"] or run["changed"]):
        say_spent(departure)
    boat_at = boat_named(url, Harbour(world=world, confirm=output.confirmation(yes=run["yes"])))
    closures = _closures_of(run, survey_file)
    onward = onward_of(run, survey_file, force=how["force"])
    with live_view(survey_file, wanted=live) as mission_socket:

        def ready(mission: Mission) -> None:
            handle_signals_for(mission)
            if mission_socket is not None:
                mission_socket.attach(mission)
            if closures is not None:
                closures.begin(mission)

        report = run_survey(
            survey_file,
            boat_at if mission_socket is None else mission_socket.with_status(boat_at),
            steered_by(rule, solver),
            now,
            _settings_for(run, now, departure.survey, departure.spent),
            replans=run["replans"],
            extends=onward and onward(None),
            listeners=[
                ProgressMeter(bar.update),
                Alarm(output.note),
                *([] if mission_socket is None else [mission_socket.on_event]),
                *([] if closures is None else [closures]),
            ],
            on_ready=ready,
            **how,
        )
        check_samples(survey_file)
    return report


def _only(urls: tuple[str, ...]) -> str:
    url, *others = urls
    if others:
        raise UsageError("One boat takes one --link; only a fleet takes several.")
    return url


def _sail_fleet(
    survey_file: SurveyFile,
    urls: tuple[str, ...],
    run: dict[str, Any],
    now: datetime,
    bar: output.MissionBar,
    instrument_sets: Mapping[int | None, InstrumentSet],
    live: bool,
    *,
    resume: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Sail all boats of a fleet with the options `run`, and print the outcome."""
    settings = _mission_settings(run, now)
    onward = onward_of(run, survey_file, force=force)
    with live_view(survey_file, wanted=live) as mission_socket:
        report = run_fleet(
            survey_file, urls, _settings(run), settings, now, bar,
            yes=run["yes"], resume=resume, force=force, instrument_sets=instrument_sets,
            replans=run["replans"], closures=lambda: _closures_of(run, survey_file),
            extends=onward, mission_socket=mission_socket, changed=run["changed"],
        )  # fmt: skip
    ahead = next_command(report, survey_file.path)
    output.result(fleet_numbers(report), as_json=as_json, next_command=ahead)
    explain(report, survey_file.path)


def _mission_settings(run: dict[str, Any], now: datetime) -> MissionSettings:
    """The settings given by the options, before the plan's battery and sortie time are added."""
    # --battery-wh, if typed now, describes the battery that is in the boat now, and full.
    used = 0.0 if run["fresh"] else None
    return MissionSettings(
        sampling=InSets() if run["in_sets_only"] else InWindow(),
        safety=replace(safety_of(run, now), used_wh=used),
    )


def _settings_for(
    run: dict[str, Any], now: datetime, survey: Survey, spent: Consumption
) -> MissionSettings:
    """The settings of one boat that has `spent` part of the plan's energy and time. A battery given
    or changed now starts full and with all of its time.
    """
    settings = _mission_settings(run, now)
    if run["changed"]:
        settings = replace(settings, safety=replace(settings.safety, used_wh=0.0))
    spent = spent if settings.safety.used_wh is None else NOTHING
    return replace(settings, safety=kept_by_plan(settings.safety, survey, spent))


def _closures_of(run: dict[str, Any], survey_file: SurveyFile) -> Closures | None:
    """The areas that --closed closes to a mission; None without that option."""
    if run["closed"] is None:
        return None
    return Closures(path=Path(run["closed"]), survey=survey_file.survey, say=output.note)


def _explain(report: MissionReport, file: Path, *, moved: bool) -> NoReturn:
    """Raise the error that says why targets are left, with advice."""
    advice = f"go on with: grebe run {file} --resume"
    if report.ended in (EndReason.LINK_LOST, EndReason.BLIND):
        raise LinkError(f"{report.message}; {advice}")
    if report.ended is EndReason.STOPPED:
        raise StoppedError(f"{report.message}; {advice}")
    if not moved and report.ended is EndReason.TARGET_GIVEN_UP:
        advice = "resuming would reach no more: plan again with a larger --shore-margin or --cell"
    missed = report.targets - report.reached
    raise IncompleteError(
        f"{missed} of {report.targets} target sets were not reached ({report.message}); {advice}"
    )


def _settings(run: dict[str, Any]) -> tuple[Rule, SolverBuilder, SimulatedWorld]:
    """Turn the options of a run into its rule, its solver and the simulated world."""
    return *rule_of(run), world_of(run)


def _as_before(ctx: click.Context, run: dict[str, Any], recorded: str) -> dict[str, Any]:
    """The options of the recorded run, overridden by those typed now."""
    typed = {name: value for name, value in run.items() if _typed(ctx, name)}
    found = run | json.loads(recorded) | typed
    refuse_foreign(found["rule"], typed)
    return found


def _typed(ctx: click.Context, name: str) -> bool:
    return ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
