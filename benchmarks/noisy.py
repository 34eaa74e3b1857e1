"""Missions in an unknown current by noisy estimates, of boats that are or are not as modelled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common import print_head, print_row
from benchmarks.missions import cells_task, towards_each
from benchmarks.optimum import Task
from grebe.control.rules.lookahead import Lookahead
from grebe.core.vessel import PRESETS, Vessel
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, Trial, meander

# Seeds of the noise; each is sailed in a current towards each direction.
SEEDS, LIMIT_S = (2, 3), 1_500.0
RECEIVERS = {
    "0.03 m/s": EstimateErrors(velocity_mps=0.03),
    "0.1 m, 0.01 rad, 0.03 m/s": EstimateErrors(
        position_m=0.1, heading_rad=0.01, velocity_mps=0.03
    ),
    "0.5 m, 0.02 rad, 0.05 m/s": EstimateErrors(
        position_m=0.5, heading_rad=0.02, velocity_mps=0.05
    ),
}
VELOCITIES, GOOD, COMMON = RECEIVERS


def as_modelled(_: Vessel) -> Conditions:
    return Conditions()


def heavier(boat: Vessel) -> Conditions:
    """Masses a quarter larger, the yaw inertia 0.3."""
    more = replace(
        boat, m11_kg=1.25 * boat.m11_kg, m22_kg=1.25 * boat.m22_kg, m33_kgm2=1.3 * boat.m33_kgm2
    )
    return Conditions(boat=more)


def draggier(boat: Vessel) -> Conditions:
    """Drags of surge and sway 0.3 larger, those of yaw a fifth smaller."""
    other = replace(
        boat,
        x_u=1.3 * boat.x_u,
        x_uu=1.3 * boat.x_uu,
        y_v=1.3 * boat.y_v,
        y_vv=1.3 * boat.y_vv,
        n_r=0.8 * boat.n_r,
        n_rr=0.8 * boat.n_rr,
    )
    return Conditions(boat=other)


def weak_to_port(_: Vessel) -> Conditions:
    """A port thruster that gives 0.8 of its thrust."""
    return Conditions(effectiveness=(0.8, 1.0))


@dataclass(frozen=True, kw_only=True)
class Case:
    """One row: the noise of its receiver, the boat, and how it differs from its model."""

    receiver: str
    boat: str
    differs: Callable[[Vessel], Conditions] = as_modelled

    @property
    def task(self) -> Task:
        """The 100 cells of 5 m, or 36 of 10 m with a window of 0.5 to 1.5 m/s."""
        if self.boat == "benchmark":
            return cells_task()
        cells = meander(rows=6, columns=6, side=10.0, speed=(0.5, 1.5))
        start = (-10.0, 5.0, 0.0, 0.0, 0.0, 0.0)
        return replace(cells_task(), vessel=PRESETS[self.boat], targets=cells, start=start)

    def flights(self) -> list[Trial]:
        """Sail it in a current towards each direction, with each seed."""
        world = replace(
            self.differs(self.task.vessel), errors=RECEIVERS[self.receiver], limit_s=LIMIT_S
        )
        moving = towards_each(self.task).values()
        return [
            one.sailed(Lookahead(), replace(world, seed=seed)) for one in moving for seed in SEEDS
        ]


CASES = [
    Case(receiver=VELOCITIES, boat="benchmark"),
    Case(receiver=GOOD, boat="benchmark"),
    Case(receiver=COMMON, boat="benchmark"),
    Case(receiver=GOOD, boat="benchmark", differs=heavier),
    Case(receiver=GOOD, boat="benchmark", differs=draggier),
    Case(receiver=GOOD, boat="benchmark", differs=weak_to_port),
    Case(receiver=VELOCITIES, boat="spyboat"),
    Case(receiver=COMMON, boat="blueboat"),
    Case(receiver=GOOD, boat="blueboat", differs=draggier),
    Case(receiver=GOOD, boat="otter", differs=heavier),
    Case(receiver=COMMON, boat="heron"),
]


def noisy() -> None:
    """Seconds of `lookahead` in 0.3 m/s of unknown current by noisy estimates."""
    print_head(
        "Unknown weather by noisy estimates: eight missions each, seconds",
        "noise of estimates", "boat", "differs from its model", "mean", "worst", "not complete",
    )  # fmt: skip
    for case in CASES:
        flights = case.flights()
        seconds = [one.duration_s for one in flights]
        lost = sum(not one.complete for one in flights)
        differs = case.differs.__doc__ or "no"
        print_row(
            case.receiver, case.boat, differs.rstrip("."), f"{np.mean(seconds):.1f}",
            f"{max(seconds):.1f}", lost,
        )  # fmt: skip
