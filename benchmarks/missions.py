"""Mission time over the optimum, for Grebe's rules and the peers."""

from __future__ import annotations

from benchmarks.common import BOAT, CELLS, START, grebe_flight, print_head, print_row
from benchmarks.optimum import optimum
from benchmarks.peers import LineOfSightPilot, SetPoint
from grebe.control.controller import Controller
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.mission.trial import fly
from grebe.paper.scenes import exploration


def missions() -> None:
    scene = exploration()
    for name, boat, cells, start in (
        ("100 cells", BOAT, CELLS, START),
        ("Fig. 7", scene.vessel, list(scene.targets), scene.start),
    ):
        _table(name, boat, cells, start)


def _table(name, boat, cells, start) -> None:
    flights = {
        f"Grebe `{name}`": grebe_flight(rule, None, boat, cells, start)
        for name, rule in (("lookahead", Lookahead()), ("dual", Dual()), ("single", Single()))
    }
    lookahead = next(iter(flights.values()))
    best, worst, solved = optimum(boat, cells, lookahead, 3, held=True)
    finer, _, finer_solved = optimum(boat, cells, lookahead, 6, held=True)
    set_point = Controller(boat, cells, SetPoint())
    flights["set-point NMPC on the centres"] = fly(boat, cells, set_point, start)
    for label, stopping in (
        ("waypoints, line of sight, PID", False),
        ("the same, stopping at each turn", True),
    ):
        flights[label] = fly(boat, cells, LineOfSightPilot(boat, cells, stopping=stopping), start)
    print_head(
        f"Mission time over the optimum, {name}",
        "controller",
        "reached",
        "mission s",
        "over the optimum",
    )
    for label, flight in flights.items():
        over = f"{flight.duration_s / best:.3f}" if flight.complete else "-"
        print_row(label, flight.arrivals, f"{flight.duration_s:.1f}", over)
    print(
        f"\nOptimum {best:.1f} s (converged: {solved}, largest violation of a set {worst:.1e}); "
        f"with half the integration step {finer:.1f} s (converged: {finer_solved})."
    )
