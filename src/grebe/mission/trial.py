"""Simulated missions without a file, for experiments, figures and benchmarks.

A trial uses the same loop, `grebe.mission.loop.Mission`. It adds a simulated boat, a recorder in
memory, and a record of the boat's true states.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import UsageError
from grebe.core.events import Estimate, SampleTaken, State, Step
from grebe.core.frames import LocalFrame
from grebe.core.sets import TargetSet, hull_of, rectangle
from grebe.core.survey import Survey, Target
from grebe.core.vessel import Vessel
from grebe.links.simulated import EXACT, EstimateErrors, SimulatedLink
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.events.statistics import MissionReport
from grebe.mission.helm import Helm
from grebe.mission.loop import Mission
from grebe.mission.measuring.sampling import EVERY_SECOND, Sampling
from grebe.mission.safety.settings import NO_FENCE, SafetySettings
from grebe.mission.settings import MissionSettings
from grebe.simulation.changing import WeatherAt
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import ReadsWater, UniformSonde

if TYPE_CHECKING:
    from numpy.typing import NDArray

EVERYWHERE_THE_SAME = UniformSonde()
SOMEWHERE = LocalFrame(origin_lon_deg=0.0, origin_lat_deg=0.0)


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """The world of a trial.

    `weather` is not known to the helm. `errors` are the errors of the estimates, `seed` is the seed
    of everything random, and the mission gives up after `limit_s`. `observes` says whether the
    weather is estimated during the trial. `safety` has no fence by default, because there is no
    shore. `boat` is the true boat if it differs from the helm's vessel; `effectiveness` is the
    share of the commanded thrust that each thruster gives.
    """

    weather: Weather | WeatherAt = CALM
    errors: EstimateErrors = EXACT
    sonde: ReadsWater = EVERYWHERE_THE_SAME
    seed: int = 0
    limit_s: float = 1000.0
    observes: bool = True
    sampling: Sampling = EVERY_SECOND
    safety: SafetySettings = NO_FENCE
    boat: Vessel | None = None
    effectiveness: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        shares = self.effectiveness
        if len(shares) != 2 or not all(0 <= share < math.inf for share in shares):
            raise UsageError(
                f"Give the share of its thrust that each of two thrusters gives, not {shares!r}."
            )


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The outcome of a trial: its report, its events, and the true track.

    `track` (n, 7): time [s] and the true state at each estimate.
    """

    report: MissionReport
    recorder: MemoryRecorder
    track: NDArray[np.float64]

    @property
    def complete(self) -> bool:
        """Whether every target was reached."""
        return self.report.complete

    @property
    def arrivals(self) -> str:
        """How many sets were reached, in words."""
        return f"{self.report.reached} of {self.report.targets}"

    @property
    def duration_s(self) -> float:
        """The time from the first estimate to the last, by the boat's clock [s]."""
        return float(self.track[-1, 0] - self.track[0, 0])

    @cached_property
    def steps(self) -> list[Step]:
        """The control steps, without the changes of thrust between two of them."""
        return [step for step in self.recorder.of(Step) if step.solve_ms is not None]

    @property
    def step_ms(self) -> list[float]:
        """CPU time of each control step [ms]."""
        return [step.solve_ms for step in self.steps if step.solve_ms is not None]

    @property
    def thrusts(self) -> NDArray[np.float64]:
        """The commanded thrusts at each row of the track, (n, 2) [N]."""
        steps = self.recorder.of(Step)
        when = np.array([step.elapsed_s for step in steps])
        told = np.array([(0.0, 0.0), *(step.thrusts for step in steps)])
        return told[np.searchsorted(when, self.track[:, 0], side="right")]

    @property
    def sampled(self) -> NDArray[np.float64]:
        """The positions of the samples, (m, 2) [m]."""
        taken = [event.sample for event in self.recorder.of(SampleTaken)]
        return np.array([(one.north_m, one.east_m) for one in taken]).reshape(-1, 2)

    @property
    def estimates(self) -> list[Estimate]:
        """The state estimates that the mission used."""
        return self.recorder.of(Estimate)


def simulate(
    vessel: Vessel,
    targets: Sequence[TargetSet],
    helm: Helm,
    start: Sequence[float],
    conditions: Conditions | None = None,
    *,
    stopwatch: Callable[[], float] = time.process_time,
) -> Trial:
    """Run a trial from the state `start` (6,) until every set is reached or the time is up.

    Raises `UsageError` if there is no target set, or `start` is not six finite numbers.
    """
    world = conditions or Conditions()
    if not targets:
        raise UsageError("There is no target set to sail through; give one or more.")
    if len(start) != 6 or not all(map(math.isfinite, start)):
        raise UsageError(f"A boat's start must be six finite numbers, not {start!r}.")
    north, east, heading, surge, sway, yaw_rate = start
    state = (north, east, heading, surge, sway, yaw_rate)
    plant = Plant(world.boat or vessel, state, world.weather, world.effectiveness)
    link = _Witness(plant, world)
    recorder = MemoryRecorder()
    report = Mission(
        bare_survey(targets, vessel),
        helm,
        link,
        recorder,
        MissionSettings(
            sampling=world.sampling,
            limit_s=world.limit_s,
            observes=world.observes,
            safety=world.safety,
        ),
        stopwatch=stopwatch,
    ).run()
    return Trial(report=report, recorder=recorder, track=np.array(link.truth))


class _Witness(SimulatedLink):
    """The simulated boat, which also records its true state at each estimate."""

    def __init__(self, plant: Plant, world: Conditions) -> None:
        super().__init__(plant, world.sonde, world.errors, world.seed)
        self.truth: list[tuple[float, ...]] = []

    def _estimate(self) -> State:
        self.truth.append((self._plant.time_s, *self._plant.state))
        return super()._estimate()


def bare_survey(targets: Sequence[TargetSet], vessel: Vessel) -> Survey:
    """Return a survey of bare target sets: their hull is the water, there are no corridors, and the
    place on earth is arbitrary.
    """
    hull = hull_of([vertex for one in targets for vertex in one.vertices])
    return Survey(
        name="trial",
        frame=SOMEWHERE,
        water=hull,
        targets=tuple(
            Target(seq=i, kind="cell", set=one, cell=one.polygon)
            for i, one in enumerate(targets, 1)
        ),
        vessel=vessel,
    )


def meander(
    rows: int = 10,
    columns: int = 10,
    side: float = 5.0,
    speed: tuple[float, float] = (1.0, 2.0),
) -> list[TargetSet]:
    """Return square cells in boustrophedon order: by default the 100 sets of the benchmarks."""
    return [
        rectangle((side * c, side * (c + 1)), (side * r, side * (r + 1)), speed)
        for r in range(rows)
        for c in (range(columns) if r % 2 == 0 else range(columns - 1, -1, -1))
    ]
