"""The receding horizon: one controller step, its warm start and its fallbacks.

In each step the rule proposes a horizon, the solver starts from the last plan, shifted, and the
first thrusts are applied. If nothing converges, the boat follows the last plan for a while, then
slows down and stops; the status of the step records this.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.control.horizon import HorizonShape, Plan, rows_needed
from grebe.control.rules.base import (
    Decision,
    Proposal,
    Rule,
    Situation,
    check_not_negative,
    reached_count,
)
from grebe.control.rules.lookahead import Lookahead
from grebe.control.separation import MOST_OTHERS, AnnouncedPath, is_taken, keep_apart
from grebe.control.slow_thrusters import SlowThrusters
from grebe.control.solvers.base import Solution, Solver, SolverBuilder, Status
from grebe.control.solvers.builders import Fast, Ipopt
from grebe.control.turn_and_go import model_substeps, turn_and_go
from grebe.core.dynamics import CALM, Weather
from grebe.core.sets import TargetSet, inner_rows
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Steps for which an old plan is followed before the boat is brought to rest.
PATIENCE_STEPS = 5
LOOK_AHEAD_SETS = 16
# Metres or metres per second by which a plan may miss a set and still count as entering it; the
# controller aims inside by a larger margin.
LARGEST_MISS = 0.03
# Seconds that a fresh plan must save to be followed instead of the last one.
WORTH_A_CHANGE = 0.2


class StepStatus(enum.Enum):
    """Source of the thrusts of a step."""

    SOLVED = "solved"
    RESTARTED = "solved from a second start"
    IMPROVED = "improved"
    LAST_PLAN = "last plan"
    STOPPING = "stopping"

    @property
    def is_solved(self) -> bool:
        """Whether the thrusts come from a plan that converged in this step."""
        return self in (StepStatus.SOLVED, StepStatus.RESTARTED, StepStatus.IMPROVED)


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Margins by which the controller aims inside its bounds, whatever the rule.

    `set_m` and `speed_mps` shrink the set that it aims at; a set counts as reached by its full
    size. `corridor_m` is the distance kept from the sides of a corridor. Raises `UsageError` for
    a margin that is negative or not finite.
    """

    set_m: float = 0.1
    speed_mps: float = 0.05
    corridor_m: float = 0.3

    def __post_init__(self) -> None:
        check_not_negative(set_m=self.set_m, speed_mps=self.speed_mps, corridor_m=self.corridor_m)


@dataclass(frozen=True, kw_only=True)
class Command:
    """The result of a step: thrusts (F_1, F_2) [N] and their origin.

    If there is a `plan`, its thrusts are followed until the next step; otherwise `thrusts` hold
    until then. `target` is the index of the set that the boat steers to, in the survey's order.
    `split` is the stage at which a rule's second mode begins, and is only recorded.
    """

    thrusts: tuple[float, float]
    plan: Plan | None = None
    status: StepStatus = StepStatus.SOLVED
    target: int = 0
    split: int = 0

    def thrusts_at(self, elapsed_s: float) -> tuple[float, float]:
        """Thrusts to apply `elapsed_s` after the step; a plan's stages may be shorter than that."""
        if self.status is StepStatus.STOPPING or self.plan is None:
            return self.thrusts
        return self.plan.thrusts_at(elapsed_s)


@dataclass(frozen=True, kw_only=True)
class _Attempt:
    """The situation and the solver of an attempt, and the status of its solution.

    `driven_in` is the weather of the turn-and-go that it starts from, None for the rule's start.
    A last resort is not tried if there is any plan to follow.
    """

    situation: Situation
    solver: Callable[[], Solver]
    status: StepStatus
    driven_in: Weather | None = None
    is_last_resort: bool = False


@dataclass(frozen=True, kw_only=True)
class _Answer:
    """A solution that could be followed, and the proposal that it solves."""

    solution: Solution
    proposal: Proposal
    status: StepStatus

    @property
    def misses(self) -> bool:
        """Whether a plan of legs misses its first set at the node where it should enter it.

        A boat that has just missed a set can be caught in a plan that pays for the miss, more at
        every step, although turning back would be cheaper. A fresh plan finds that.
        """
        entries = self.proposal.decision.entries
        if not entries:
            return False
        rows = self.proposal.horizon.entry_sets[entries[0]]
        at_entry = self.solution.plan.states[entries[0]][[0, 1, 3]]
        return bool(np.max(rows[:, :3] @ at_entry - rows[:, 3]) > LARGEST_MISS)

    def or_cheaper(self, other: _Answer) -> _Answer:
        """The other answer if it is cheaper by more than `WORTH_A_CHANGE`, else this one."""
        return other if other.solution.cost < self.solution.cost - WORTH_A_CHANGE else self


class Controller:
    """Steers a vessel through target sets in their order, by a rule.

    `reached` counts the sets reached so far (Definition 5). `targets[reached]` is the current
    target set Omega_x (Definition 6); `done` is true when none is left. `corridors` holds for each
    target the convex polygon to stay in on the way to it, or is empty. `solver` builds the solver,
    `second_solver` the one that is called when the first fails; the second is built when it is
    first needed.
    """

    def __init__(
        self,
        vessel: Vessel,
        targets: Sequence[TargetSet],
        rule: Rule | None = None,
        *,
        reached: int = 0,
        corridors: Sequence[shapely.Polygon] = (),
        margins: Margins | None = None,
        solver: SolverBuilder | None = None,
        second_solver: SolverBuilder | None = None,
    ) -> None:
        if len(corridors) not in (0, len(targets)):
            raise ValueError(
                f"{len(targets)} targets have {len(corridors)} corridors; give one each"
            )
        if not 0 <= reached <= len(targets):
            raise ValueError(f"{reached} of {len(targets)} targets cannot be reached already")
        self.vessel = vessel
        self.targets = tuple(targets)
        self.rule: Rule = rule or Lookahead()
        self.reached = reached
        kept = margins or Margins()
        self._corridors = tuple(inner_rows(corridor, kept.corridor_m) for corridor in corridors)
        self._aims = [target.shrunk(kept.set_m, kept.speed_mps) for target in self.targets]
        self.shape = HorizonShape(
            stages=self.rule.stages,
            set_rows=rows_needed([len(aim.vertices) for aim in self._aims]),
            corridor_rows=max(map(len, self._corridors), default=0),
            substeps=model_substeps(vessel, self.rule.longest_stage_s),
        )
        self._builder = solver or Fast()
        self._solver = self._builder.build(vessel, self.shape)
        self._second_builder = second_solver or Ipopt()
        self._second: Solver | None = None
        self._plan: Plan | None = None
        self._decision: Decision | None = None
        self._unsolved_in_a_row = 0
        self._thrusters: SlowThrusters | None = None
        self._others: tuple[Sequence[AnnouncedPath], float] = ((), 0.0)

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        return self.rule.step_s

    def take_for(self, vessel: Vessel) -> None:
        """Plan for another model of the boat from now on."""
        self.vessel = vessel
        substeps = model_substeps(vessel, self.rule.longest_stage_s)
        self._solve_for(replace(self.shape, substeps=substeps))

    def expect(self, thrusters: SlowThrusters | None) -> None:
        """Plan the next step for thrusters with a lag, or without if None."""
        self._thrusters = thrusters

    def heed(self, others: Sequence[AnnouncedPath], apart_m: float) -> None:
        """Keep `apart_m` from the announced positions of others in the next step's plan."""
        self._others = (others, apart_m)
        if others and not self.shape.apart_rows:
            self._solve_for(replace(self.shape, apart_rows=MOST_OTHERS))

    def _solve_for(self, shape: HorizonShape) -> None:
        """Build the solver for problems of another shape."""
        self.shape = shape
        self._solver = self._builder.build(self.vessel, shape)
        self._second = None

    @property
    def done(self) -> bool:
        """Whether every set has been reached."""
        return self.reached >= len(self.targets)

    def see(self, state: Sequence[float]) -> int:
        """Count the sets that a state estimate reaches, and return how many are newly reached.

        Call it with every estimate.
        """
        before = self.reached
        self.reached = reached_count(self.targets, self.reached, state)
        return self.reached - before

    def step(
        self, state: Sequence[float], weather: Weather = CALM, elapsed_s: float | None = None
    ) -> Command:
        """Return the thrusts to apply from `state` on for one control step.

        `elapsed_s` is the time since the last step, by default the rule's. It differs if the
        estimate came late.
        """
        if self.done:
            raise ValueError("every target set is reached: there is nothing to steer to")
        z = np.asarray(state, dtype=float)
        if z.shape != (6,) or not np.all(np.isfinite(z)):
            raise ValueError(f"a state must be six finite numbers, not {state}")
        wind = np.asarray(weather.as_tuple())
        elapsed = self.rule.step_s if elapsed_s is None else elapsed_s
        if not 0 <= elapsed < math.inf:
            raise ValueError(f"the time since the last step is {elapsed} s; give 0 or more")
        situation = self._situation(z, elapsed)
        best: _Answer | None = None
        for attempt in self._attempts(situation, weather):
            if best is not None and attempt.is_last_resort:
                break
            proposal = self.rule.propose(attempt.situation, self.shape)
            start = self.roll_out(z, weather) if proposal.start is None else proposal.start
            if attempt.driven_in is not None:
                start = self.roll_out(z, attempt.driven_in, start.durations)
            if self._thrusters is not None:
                proposal.horizon.thrust_bounds = self._thrusters.reach(start.durations)
            if self._others[0]:
                keep_apart(proposal.horizon, start, *self._others)
            solution = attempt.solver().solve(z, proposal.horizon, wind, start)
            self._decision = proposal.decision
            if solution.status is not Status.NOT_CONVERGED:
                own = attempt.status if solution.solved else StepStatus.IMPROVED
                answer = _Answer(solution=solution, proposal=proposal, status=own)
                best = answer if best is None else best.or_cheaper(answer)
                if not best.misses:
                    break
        return self._fall_back(z, elapsed) if best is None else self._accept(best)

    def _attempts(self, situation: Situation, weather: Weather) -> Iterator[_Attempt]:
        """The attempts of a step, until one succeeds.

        The first starts from the last plan, the second afresh. Where the weather is strong for the
        boat, the straight lines of a fresh start can be far from any motion that it is capable of;
        a motion of the boat is then a better start, if it does not run away in that weather. The
        second solver is slow. A failed step can follow the last plan, so the last resorts wait
        until a second step fails, and the second solver is called in that alone.
        """
        afresh = _Attempt(
            situation=replace(situation, plan=None),
            solver=lambda: self._solver,
            status=StepStatus.RESTARTED,
        )
        yield replace(afresh, situation=situation, status=StepStatus.SOLVED)
        yield afresh
        if self._plan is None or self._unsolved_in_a_row:
            for water in (weather, CALM):
                yield replace(afresh, driven_in=water, is_last_resort=True)
        if self._plan is None or self._unsolved_in_a_row == 1:
            yield replace(afresh, solver=self._second_solver, is_last_resort=True)

    def roll_out(
        self,
        state: NDArray[np.float64],
        weather: Weather = CALM,
        durations: NDArray[np.float64] | None = None,
    ) -> Plan:
        """Return a trajectory that turns towards Omega_x and drives at it.

        Its stages have `durations` (N,) [s], by default the rule's step each.
        """
        if durations is None:
            durations = np.full(self.rule.stages, self.rule.step_s)
        return turn_and_go(self.vessel, self.targets[self.reached], state, durations, weather)

    def _situation(self, state: NDArray[np.float64], elapsed_s: float) -> Situation:
        ahead = slice(self.reached, self.reached + self._seen_ahead())
        return Situation(
            state=state.tolist(),
            target=self.reached,
            ahead=self.targets[ahead],
            aims=self._aims[ahead],
            last=self._decision,
            plan=None if self._unsolved_in_a_row else self._plan,
            elapsed_s=elapsed_s,
            cruise_thrust_n=0.5 * self.vessel.surge_drag_n(self._pace()),
            corridors=self._corridors[ahead],
        )

    def _seen_ahead(self) -> int:
        """Number of sets to plan for: those before the first one blocked by others, at least one.

        A plan that cannot reach its end postpones what it could do at once.
        """
        others, apart_m = self._others
        ahead = self.targets[self.reached : self.reached + LOOK_AHEAD_SETS]
        for count, target in enumerate(ahead) if others else ():
            if any(is_taken(target, other, apart_m) for other in others):
                return max(count, 1)
        return len(ahead)

    def _pace(self) -> float:
        """Middle of the current target's speed window [m/s]."""
        target = self.targets[self.reached]
        return 0.5 * (target.speed_min_mps + target.speed_max_mps)

    def _second_solver(self) -> Solver:
        """The second solver, built on first use."""
        if self._second is None:
            self._second = self._second_builder.build(self.vessel, self.shape)
        return self._second

    def _accept(self, answer: _Answer) -> Command:
        self._plan = plan = answer.solution.plan
        self._decision = answer.proposal.decision
        self._unsolved_in_a_row = 0
        return self._command(plan.first_input, plan, answer.status)

    def _fall_back(self, state: NDArray[np.float64], elapsed_s: float) -> Command:
        """Follow the last plan for a while, then stop, because nothing converged."""
        self._unsolved_in_a_row += 1
        if self._plan is not None and self._unsolved_in_a_row <= PATIENCE_STEPS:
            self._plan = self._plan.shifted(elapsed_s)
            return self._command(self._plan.first_input, self._plan, StepStatus.LAST_PLAN)
        plan = self.roll_out(state)
        return self._command(self._braking(state), plan, StepStatus.STOPPING)

    def _command(self, thrusts: tuple[float, float], plan: Plan, status: StepStatus) -> Command:
        split = self._decision.split if self._decision else 0
        return Command(thrusts=thrusts, plan=plan, status=status, target=self.reached, split=split)

    def _braking(self, state: NDArray[np.float64]) -> tuple[float, float]:
        """Thrust that stops the surge within about a step, without turning."""
        wanted = -0.5 * self.vessel.m11_kg * state[3] / max(self.rule.step_s, 0.5)
        thrust = float(np.clip(wanted, self.vessel.thrust_min_n, self.vessel.thrust_max_n))
        return thrust, thrust
