"""grebe run for a survey planned for several boats: all of them sail at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from grebe.cli import output
from grebe.cli.interruption import handle_signals_for
from grebe.cli.run_preview import say_spent
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.core.errors import IncompleteError, StoppedError, UsageError
from grebe.core.survey import SIMULATED_WATER
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink
from grebe.links.instruments.instrument import InstrumentSet
from grebe.mission.departure import Departure
from grebe.mission.events.recorders import Listener
from grebe.mission.events.statistics import Alarm, Progress, ProgressMeter
from grebe.mission.loop import Mission
from grebe.mission.settings import MissionSettings
from grebe.workflow.boats import SIMULATED, Harbour, boat_named
from grebe.workflow.closures import Closures
from grebe.workflow.fleets import ExtensionOf, FleetReport, FleetRun
from grebe.workflow.instruments import of_fleet
from grebe.workflow.one_water import refuse_other_water
from grebe.workflow.quality import check_samples
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

if TYPE_CHECKING:
    from grebe.server.mission_socket import MissionSocket


@dataclass
class FleetMeter:
    """Shows the progress of all boats together towards the survey's `targets`."""

    bar: output.MissionBar
    targets: int
    _of: dict[int, Progress] = field(default_factory=dict[int, Progress])

    def listeners(self, boat: int) -> Sequence[Listener]:
        """The listeners of one boat's mission."""
        return [
            ProgressMeter(lambda progress: self._update(boat, progress)),
            Alarm(lambda text: output.note(f"boat {boat}: {text}")),
        ]

    def _update(self, boat: int, progress: Progress) -> None:
        self._of[boat] = progress
        each = list(self._of.values())
        self.bar.update(
            Progress(
                reached=sum(one.reached for one in each),
                # Boats that have not set out yet report no targets.
                targets=max(self.targets, sum(one.targets for one in each)),
                boat_time_s=max(one.boat_time_s for one in each),
                samples=sum(one.samples for one in each),
            )
        )


@dataclass
class FleetListeners:
    """Everything that listens to the boats' missions or gives them orders: the terminal's `meter`,
    the `closing` of areas to each boat, and the app's `mission_socket`.
    """

    meter: FleetMeter
    closing: Mapping[int, Closures]
    mission_socket: MissionSocket | None

    def of(self, boat: int) -> list[Listener]:
        """The listeners of one boat's mission."""
        watching = (
            []
            if self.mission_socket is None
            else [partial(self.mission_socket.on_event, boat=boat)]
        )
        closes = [self.closing[boat]] if boat in self.closing else []
        return [*self.meter.listeners(boat), *watching, *closes]

    def attach(self, boat: int, mission: Mission) -> None:
        """Attach to a mission before it begins."""
        handle_signals_for(mission)
        if self.mission_socket is not None:
            self.mission_socket.attach(mission, boat)
        if boat in self.closing:
            self.closing[boat].begin(mission)

    def with_status(
        self, boat_at: Callable[[Departure], BoatLink]
    ) -> Callable[[Departure], BoatLink]:
        """The same link, which also reports to the app."""
        return boat_at if self.mission_socket is None else self.mission_socket.with_status(boat_at)


def run_fleet(
    survey_file: SurveyFile,
    urls: Sequence[str],
    how: tuple[Rule, SolverBuilder, SimulatedWorld],
    settings: MissionSettings,
    now: datetime,
    bar: output.MissionBar,
    *,
    yes: bool,
    resume: bool,
    force: bool,
    instrument_sets: Mapping[int | None, InstrumentSet],
    replans: bool,
    closures: Callable[[], Closures | None],
    extends: ExtensionOf | None,
    mission_socket: MissionSocket | None,
    changed: Collection[int],
) -> FleetReport:
    """Sail a fleet's survey and check the quality of its samples.

    `urls`: one link for all boats, or one for each. `instrument_sets`: the instruments of some
    boats. `closures` makes the closed areas of one mission (None: nothing is closed). `extends`
    makes the function that plans the adaptive part of a mission. `mission_socket`: that of the app.
    `changed`: the boats whose batteries were changed.
    """
    rule, solver, world = how
    fleet = survey_file.survey.fleet
    assert fleet is not None
    links = _links_of(urls, fleet.boats)
    simulated = all(link == SIMULATED for link in links)
    listeners = FleetListeners(
        meter=FleetMeter(bar, len(survey_file.survey.targets)),
        closing={k: made for k in range(1, fleet.boats + 1) if (made := closures())},
        mission_socket=mission_socket,
    )

    def boat_at(boat: int, departure: Departure) -> BoatLink:
        say_spent(departure)
        harbour = Harbour(world=replace(world, boat=boat), confirm=output.confirmation(yes=yes))
        return listeners.with_status(boat_named(links[boat - 1], harbour))(departure)

    if not force:
        refuse_other_water(survey_file, simulated=SIMULATED in links)
    survey_file.set_meta("water", _water_of(links))
    report = FleetRun(
        survey_file,
        boat_at,
        steered_by(rule, solver),
        settings,
        shares_time=simulated,
        watches=listeners.of,
        on_ready=listeners.attach,
        instruments=of_fleet(instrument_sets, fleet.boats),
        replans=replans,
        extends=extends,
        changed=changed,
    ).run(now, resume=resume, force=force)
    check_samples(survey_file)
    return report


def _water_of(links: Sequence[str]) -> str:
    """The note on the water. Readings of which some are simulated count as simulated."""
    boats = f"{len(links)} boats"
    named = f"{boats}: {', '.join(dict.fromkeys(links))}"
    if SIMULATED not in links:
        return named
    return f"{SIMULATED_WATER}, {boats if set(links) == {SIMULATED} else named}"


def _links_of(urls: Sequence[str], boats: int) -> list[str]:
    """The link of each boat; only the simulated world serves all boats with one link."""
    if len(urls) == 1 and urls[0] == SIMULATED:
        return [SIMULATED] * boats
    if len(urls) == 1:
        raise UsageError(f"Give a --link for each of the {boats} boats, in their order.")
    if len(urls) != boats:
        raise UsageError(f"{boats} boats need {boats} --link options, in their order.")
    return list(urls)


def fleet_numbers(report: FleetReport) -> dict[str, Any]:
    """The numbers printed after a fleet's run."""
    return {
        "reached": report.reached,
        "targets": report.targets,
        "duration_s": round(report.duration_s, 1),
        "samples": sum(one.samples for *_, one in report.missions),
        "energy_wh": round(sum(one.energy_wh for *_, one in report.missions), 2),
        "unsolved_steps": sum(one.unsolved_steps for *_, one in report.missions),
        "boats": [
            f"{boat}: sortie {sortie}, {one.reached} of {one.targets} targets, "
            f"{one.duration_s / 60:.1f} min, {one.ended.value if one.ended else 'not begun'}"
            for boat, sortie, one in report.missions
        ],
    }


def next_command(report: FleetReport, file: object) -> str:
    """The next command after a fleet's run."""
    path = output.quoted(file)
    return f"grebe run {path} --resume" if report.goes_on else f"grebe map {path} --out maps"


def explain(report: FleetReport, file: object) -> None:
    """Print which boats wait ashore; raise an error if targets are left for any other reason."""
    if report.ashore:
        who = " and ".join(map(str, report.ashore))
        output.note(
            f"at the harbour, and not setting out again by themselves: boat {who}; check their "
            "batteries, then resume"
        )
    if report.complete or report.goes_on:
        return
    advice = f"go on with: grebe run {file} --resume"
    if report.stopped:
        raise StoppedError(f"stopped by the operator; {advice}")
    missed = report.targets - report.reached
    raise IncompleteError(f"{missed} of {report.targets} target sets were not reached; {advice}")
