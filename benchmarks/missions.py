"""Mission time over the optimum, for Grebe's rules and the peers: in open water, on a lake with
islands, and in a current that the helm does not know.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from benchmarks.common import BOAT, CELLS, START, print_head, print_row
from benchmarks.optimum import Optimum, Task, as_plan, optima, optimum
from benchmarks.peers import LineOfSightPilot, SetPoint
from benchmarks.planning import FRAME, lake
from grebe.control.controller import Controller, Margins
from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.core.dynamics import Weather
from grebe.core.plan_settings import PlanSettings
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, Trial
from grebe.paper.scenes import exploration
from grebe.planning.planner import plan
from grebe.planning.region import Region

LAKE_CELLS = 80
# Integration steps in each stage of an optimum; with three, integration errors drove the boat.
SUBSTEPS = 6
CURRENT_MPS = 0.3
TOWARDS = {"north": (1, 0), "east": (0, 1), "south": (-1, 0), "west": (0, -1)}
NOISE = EstimateErrors(velocity_mps=0.03)
SEEDS = range(4)
# Closer to the edges of the sets: another flight from which to start the optimum.
CLOSER_M = 0.05


def cells_task() -> Task:
    """The 100 cells that all benchmarks sail."""
    return Task(vessel=BOAT, targets=CELLS, start=START)


def figure_task() -> Task:
    """The paper's Fig. 7."""
    scene = exploration()
    return Task(vessel=scene.vessel, targets=list(scene.targets), start=scene.start)


def lake_task() -> Task:
    """The concave lake with its peninsula and islands, planned as a user's lake is planned."""
    region = Region(name="lake", frame=FRAME, water=lake(LAKE_CELLS))
    survey = plan(region, BOAT, PlanSettings()).survey
    start = survey.start.at_rest()
    return Task(vessel=BOAT, targets=survey.sets, start=start, corridors=survey.corridors)


CELLS_100, FIGURE, LAKE = "100 cells", "Fig. 7", "a concave lake with islands"
TASKS = {CELLS_100: cells_task, FIGURE: figure_task, LAKE: lake_task}
IN_CURRENTS = (CELLS_100, LAKE)


@cache
def task(scene: str) -> Task:
    """The task of a scene in still water."""
    return TASKS[scene]()


@cache
def flight(scene: str, set_m: float = Margins().set_m) -> Trial:
    """The scene sailed by `lookahead` in still water, aiming `set_m` inside the sets."""
    return task(scene).sailed(Lookahead(), set_m=set_m)


@cache
def best(scene: str) -> Optimum:
    """The optimum of a scene in still water. On the lake, where paths differ, the lesser of two."""
    margins = (Margins().set_m, CLOSER_M) if scene == LAKE else (Margins().set_m,)
    guesses = [as_plan(task(scene), flight(scene, margin)) for margin in margins]
    return optimum(task(scene), guesses, SUBSTEPS)


@cache
def best_in_currents(scene: str) -> dict[str, Optimum | None]:
    """The optimum that knows its current, towards each direction; None where none was found."""
    moving = towards_each(task(scene))
    asked = [
        (one, [as_plan(one, one.sailed(Lookahead())), best(scene).plan]) for one in moving.values()
    ]
    return dict(zip(moving, optima(asked, SUBSTEPS), strict=True))


def towards_each(still: Task) -> dict[str, Task]:
    """The task in a current towards each direction."""
    return {
        name: replace(
            still,
            weather=Weather(
                current_north_mps=CURRENT_MPS * north, current_east_mps=CURRENT_MPS * east
            ),
        )
        for name, (north, east) in TOWARDS.items()
    }


def noisy(moving: Task, rule: Rule) -> list[Trial]:
    """Flights by noisy estimates, each with its own noise."""
    return [moving.sailed(rule, Conditions(errors=NOISE, seed=seed)) for seed in SEEDS]


def missions() -> None:
    _open_water(CELLS_100)
    _open_water(FIGURE)
    _islands()
    in_currents()


def _open_water(scene: str) -> None:
    sailed = task(scene)
    flights = {"Grebe `lookahead`": flight(scene)}
    for label, rule in (("dual", Dual()), ("single", Single())):
        flights[f"Grebe `{label}`"] = sailed.sailed(rule)
    set_point = Controller(sailed.vessel, sailed.targets, SetPoint())
    flights["set-point NMPC on the centres"] = sailed.sailed_by(set_point)
    for label, stopping in (
        ("waypoints, line of sight, PID", False),
        ("the same, stopping at each turn", True),
    ):
        pilot = LineOfSightPilot(sailed.vessel, sailed.targets, stopping=stopping)
        flights[label] = sailed.sailed_by(pilot)
    _table(scene, flights)


def _islands() -> None:
    flights = {
        "Grebe `lookahead`": flight(LAKE),
        f"the same, {CLOSER_M} m inside the sets": flight(LAKE, CLOSER_M),
        "Grebe `dual`": task(LAKE).sailed(Dual()),
    }
    _table(LAKE, flights)


def _table(scene: str, flights: dict[str, Trial]) -> None:
    print_head(
        f"Mission time over the optimum, {scene}, {len(task(scene).targets)} targets",
        "controller", "reached", "mission s", "over the optimum", "Wh",
    )  # fmt: skip
    for label, one in flights.items():
        over = f"{one.duration_s / best(scene).duration_s:.3f}" if one.complete else "-"
        energy = f"{one.report.energy_wh:.2f}"
        print_row(label, one.arrivals, f"{one.duration_s:.1f}", over, energy)
    print(f"\nOptimum {best(scene)}.")


def in_currents() -> None:
    """Each scene in a current that the helm does not know, over the optimum that knows it."""
    print_head(
        f"Mission time in an unknown current of {CURRENT_MPS} m/s with noise of "
        f"{NOISE.velocity_mps} m/s, over the optimum that knows it; {len(SEEDS)} flights each",
        "scene", "towards", "optimum", "`lookahead` s", "over it, mean / worst", "Wh",
        "`dual` s", "over it, mean / worst", "Wh",
    )  # fmt: skip
    for scene in IN_CURRENTS:
        for towards, moving in towards_each(task(scene)).items():
            least = best_in_currents(scene)[towards]
            flights = [noisy(moving, rule) for rule in (Lookahead(), Dual())]
            columns = [column for one in flights for column in _summed_up(one, least)]
            print_row(scene, towards, least or "not found", *columns)


def _summed_up(flights: list[Trial], least: Optimum | None) -> tuple[str, str, str]:
    """Mean time, its ratio to the optimum's with the worst one, and mean energy."""
    if not all(flight.complete for flight in flights):
        return f"{sum(flight.complete for flight in flights)} complete", "-", "-"
    times = [flight.duration_s for flight in flights]
    mean, worst = sum(times) / len(times), max(times)
    energy = sum(flight.report.energy_wh for flight in flights) / len(flights)
    over = f"{mean / least.duration_s:.3f} / {worst / least.duration_s:.3f}" if least else "-"
    return f"{mean:.1f}", over, f"{energy:.2f}"
