"""Mission time over the optimum, for Grebe's rules and the peers: in open water, on a lake with
islands, and in a current that the helm is not told.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.common import BOAT, CELLS, START, print_head, print_row
from benchmarks.optimum import Optimum, Task, flown, optimum
from benchmarks.peers import LineOfSightPilot, SetPoint
from benchmarks.planning import FRAME, lake
from grebe.control.controller import Controller
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
SUBSTEPS = 3
CURRENT_MPS = 0.3
TOWARDS = {"north": (1, 0), "east": (0, 1), "south": (-1, 0), "west": (0, -1)}
NOISE = EstimateErrors(velocity_mps=0.03)
SEEDS = range(4)
# Closer to the edges of the sets: another flight to start the optimum from.
CLOSER_M = 0.05


def missions() -> None:
    scene = exploration()
    cells = Task(vessel=BOAT, targets=CELLS, start=START)
    figure = Task(vessel=scene.vessel, targets=list(scene.targets), start=scene.start)
    islands = lake_task()
    best = _open_water("100 cells", cells)
    _open_water("Fig. 7", figure)
    best_of_lake = _islands(islands)
    in_currents({"100 cells": (cells, best), "lake": (islands, best_of_lake)})


def lake_task() -> Task:
    """The concave lake with its peninsula and islands, planned as a user's lake is planned."""
    region = Region(name="lake", frame=FRAME, water=lake(LAKE_CELLS))
    survey = plan(region, BOAT, PlanSettings()).survey
    start = survey.start.at_rest()
    return Task(vessel=BOAT, targets=survey.sets, start=start, corridors=survey.corridors)


def _open_water(name: str, task: Task) -> Optimum:
    rules = (("lookahead", Lookahead()), ("dual", Dual()), ("single", Single()))
    flights = {f"Grebe `{label}`": task.sailed(rule) for label, rule in rules}
    guess = flown(task, next(iter(flights.values())))
    best = optimum(task, [guess], SUBSTEPS)
    finer = optimum(task, [guess], 2 * SUBSTEPS)
    set_point = Controller(task.vessel, task.targets, SetPoint())
    flights["set-point NMPC on the centres"] = task.sailed_by(set_point)
    for label, stopping in (
        ("waypoints, line of sight, PID", False),
        ("the same, stopping at each turn", True),
    ):
        pilot = LineOfSightPilot(task.vessel, task.targets, stopping=stopping)
        flights[label] = task.sailed_by(pilot)
    _table(name, flights, best)
    print(f"With half the integration step {finer}.")
    return best


def _islands(task: Task) -> Optimum:
    flights = {
        "Grebe `lookahead`": task.sailed(Lookahead()),
        f"the same, {CLOSER_M} m inside the sets": task.sailed(Lookahead(), set_m=CLOSER_M),
    }
    best = optimum(task, [flown(task, flight) for flight in flights.values()], SUBSTEPS)
    flights["Grebe `dual`"] = task.sailed(Dual())
    _table(f"a concave lake with islands, {len(task.targets)} targets", flights, best)
    return best


def _table(name: str, flights: dict[str, Trial], best: Optimum) -> None:
    print_head(
        f"Mission time over the optimum, {name}",
        "controller", "reached", "mission s", "over the optimum", "Wh",
    )  # fmt: skip
    for label, flight in flights.items():
        over = f"{flight.duration_s / best.duration_s:.3f}" if flight.complete else "-"
        energy = f"{flight.report.energy_wh:.2f}"
        print_row(label, flight.arrivals, f"{flight.duration_s:.1f}", over, energy)
    print(f"\nOptimum {best}.")


def in_currents(scenes: dict[str, tuple[Task, Optimum]]) -> None:
    """Each scene in a current that the helm is not told, over the optimum that knows it."""
    print_head(
        f"Mission time in an unknown current of {CURRENT_MPS} m/s with noise of "
        f"{NOISE.velocity_mps} m/s, over the optimum that knows it; {len(SEEDS)} flights each",
        "scene", "towards", "optimum", "`lookahead` s", "over it, mean / worst", "Wh",
        "`dual` s", "over it, mean / worst", "Wh",
    )  # fmt: skip
    for name, (still, best_in_still) in scenes.items():
        for towards, task in towards_each(still).items():
            flights = {rule: _noisy(task, rule) for rule in (Lookahead(), Dual())}
            guesses = [flown(task, task.sailed(Lookahead())), best_in_still.plan]
            best = optimum(task, guesses, SUBSTEPS)
            columns = [column for one in flights.values() for column in _summed_up(one, best)]
            print_row(name, towards, best, *columns)


def towards_each(task: Task) -> dict[str, Task]:
    """The task in a current towards each direction."""
    return {
        name: replace(
            task,
            weather=Weather(
                current_north_mps=CURRENT_MPS * north, current_east_mps=CURRENT_MPS * east
            ),
        )
        for name, (north, east) in TOWARDS.items()
    }


def _noisy(task: Task, rule: Lookahead | Dual) -> list[Trial]:
    return [task.sailed(rule, Conditions(errors=NOISE, seed=seed)) for seed in SEEDS]


def _summed_up(flights: list[Trial], best: Optimum) -> tuple[str, str, str]:
    """Mean time, its ratio to the optimum's with the worst one, and mean energy."""
    if not all(flight.complete for flight in flights):
        return f"{sum(flight.complete for flight in flights)} complete", "-", "-"
    times = [flight.duration_s for flight in flights]
    mean, worst = sum(times) / len(times), max(times)
    energy = sum(flight.report.energy_wh for flight in flights) / len(flights)
    over = f"{mean / best.duration_s:.3f} / {worst / best.duration_s:.3f}"
    return f"{mean:.1f}", over, f"{energy:.2f}"
