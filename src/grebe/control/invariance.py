"""Control invariance of a target set (Definition 1) and its input set Psi, by search.

Lemmas 4 and 7 need every Omega_j to be a (contractive) control invariant set. A set is a
polygon times a window of surge, free in heading, sway and yaw rate. Its invariance depends on the
boat: from each state of the set, is there a thrust, held for a step, that ends in the set?
`search` looks for a state without such a thrust, `counterexample` proves numerically that a state
has none, and `input_share` estimates the size of Psi.

A state's excess is the largest a z - b over the set's rows after one step: zero or less
inside, below zero in the interior. The rows' normals are unit vectors, so the excess changes by no
more than the step's end does in (x, y, u). This turns a grid of inputs into a proof.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc

from grebe.control.solvers.fast.derivatives import linearise
from grebe.control.solvers.fast.reach import excesses
from grebe.core.dynamics import CALM
from grebe.core.errors import UsageError
from grebe.core.motion import advance, parameter_vector
from grebe.core.sets import TargetSet
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

COARSE, FINE = 21, 121
ZOOMS = 4
# Sensitivities are computed at the grid's points; between them they may be half as large again.
SENSITIVITY_ALLOWANCE = 1.5
STEPS_PER_TIME_CONSTANT = 4


@dataclass(frozen=True, kw_only=True)
class FreeBounds:
    """Bounds of the compact X in the states that a target set leaves free: sway and yaw rate."""

    sway_mps: float = 0.0
    yaw_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.sway_mps < math.inf and 0 <= self.yaw_rate_radps < math.inf):
            raise UsageError("Bounds of sway and yaw rate must be finite and not negative.")


@dataclass(frozen=True, kw_only=True)
class Counterexample:
    """A state that no input keeps in the set, and the numbers that prove it.

    For every point of a grid over all admissible inputs, the state ends at least `least_excess` [m
    or m/s] outside. Between two points of the grid it can be nearer by `between` at most.
    """

    state: tuple[float, ...]
    least_excess: float
    between: float

    @property
    def proven(self) -> bool:
        """Whether it is proven that no input can keep the state in the set."""
        return self.least_excess > self.between


@dataclass(frozen=True, kw_only=True)
class InvarianceSearch:
    """Result of a search.

    It has the number of states tried, how many of them an input keeps in the set and in its
    interior, the worst state's least excess, and a counterexample if one was proven.
    """

    states: int
    kept: int
    kept_inside: int
    worst_excess: float
    counterexample: Counterexample | None

    @property
    def holds_as_far_as_seen(self) -> bool:
        """Whether every state tried is kept: evidence for invariance, not a proof."""
        return self.counterexample is None and self.kept == self.states


class SetCheck:
    """Tests the invariance of one target set, for one vessel and one control step [s]."""

    def __init__(self, vessel: Vessel, target: TargetSet, step_s: float) -> None:
        if not 0 < step_s < math.inf:
            raise UsageError(f"The control step is {step_s} s; it must be positive.")
        self.vessel, self.target, self.step_s = vessel, target, step_s
        self._rows = target.halfspaces
        self._parameters = parameter_vector(vessel, np.asarray(CALM.as_tuple()))
        self._substeps = max(
            2, math.ceil(STEPS_PER_TIME_CONSTANT * step_s * vessel.fastest_rate_hz)
        )

    def least_excess(self, state: Array) -> tuple[float, Array]:
        """The least excess that an input can achieve, and that input, by a grid that zooms in."""
        low, high = self.vessel.thrust_min_n, self.vessel.thrust_max_n
        centre, half = np.full(2, 0.5 * (low + high)), 0.5 * (high - low)
        best = math.inf
        for _ in range(ZOOMS):
            inputs = np.clip(centre + _grid(-half, half, COARSE), low, high)
            out, k = self._excesses(state, inputs)
            if out[k] < best:
                best, centre = float(out[k]), inputs[k]
            half *= 4.0 / COARSE
        return best, centre

    def counterexample(self, state: Array) -> Counterexample:
        """The least excess of one state on a fine grid of inputs, and its error bound."""
        low, high = self.vessel.thrust_min_n, self.vessel.thrust_max_n
        inputs = _grid(low, high, FINE)
        out, k = self._excesses(state, inputs)
        # No input is farther from a point of the grid than half a diagonal of its mesh.
        reach = math.sqrt(0.5) * (high - low) / (FINE - 1)
        steepest = max(self._sensitivity(state, pair) for pair in _grid(low, high, COARSE))
        return Counterexample(
            state=tuple(state.tolist()),
            least_excess=float(out[k]),
            between=SENSITIVITY_ALLOWANCE * steepest * reach,
        )

    def search(self, bounds: FreeBounds, states: int = 2048, seed: int = 0) -> InvarianceSearch:
        """Test the states on the rim that point outwards, then a Sobol sequence over the set."""
        tried = np.vstack([self._outward_states(), self._spread_states(bounds, states, seed)])
        least = np.array([self.least_excess(state)[0] for state in tried])
        worst = int(np.argmax(least))
        found = self.counterexample(tried[worst]) if least[worst] > 0 else None
        return InvarianceSearch(
            states=len(tried),
            kept=int(np.sum(least <= 0)),
            kept_inside=int(np.sum(least < 0)),
            worst_excess=float(least[worst]),
            counterexample=found if found is not None and found.proven else None,
        )

    def input_share(self, bounds: FreeBounds, grid: int = COARSE) -> float:
        """Share of a grid over U that belongs to Psi: inputs under which some state stays."""
        inputs = _grid(self.vessel.thrust_min_n, self.vessel.thrust_max_n, grid)
        return float(np.mean([self.witness(pair, bounds) is not None for pair in inputs]))

    def witness(self, thrusts: Array, bounds: FreeBounds) -> Array | None:
        """A state of the set that stays in it under `thrusts`; None if none was found.

        Positions enter no equation of motion, so the step's displacement is known before the
        position is chosen: the displacement is centred on the middle of the set.
        """
        speeds = np.linspace(self.target.speed_min_mps, self.target.speed_max_mps, 9)
        sways = np.linspace(-bounds.sway_mps, bounds.sway_mps, 5 if bounds.sway_mps else 1)
        turns = np.linspace(
            -bounds.yaw_rate_radps, bounds.yaw_rate_radps, 5 if bounds.yaw_rate_radps else 1
        )
        middle = np.asarray(self.target.centre)
        for heading, u, v, r in itertools.product((0.0, 0.5 * math.pi), speeds, sways, turns):
            state = np.array([*middle, heading, u, v, r])
            after = np.empty(6)
            advance(self._parameters, state, thrusts, self.step_s, self._substeps, after)
            state[:2] -= 0.5 * (after[:2] - middle)
            out, _ = self._excesses(state, thrusts[None])
            if out[0] <= 0 and self.target.contains(state.tolist()):
                return state
        return None

    def _excesses(self, state: Array, inputs: Array) -> tuple[Array, int]:
        out = np.empty(len(inputs))
        k = excesses(self._parameters, state, inputs, self.step_s, self._substeps, self._rows, out)
        return out, int(k)

    def _sensitivity(self, state: Array, thrusts: Array) -> float:
        """Largest stretch of (x, y, u) at the end of the step per newton of thrust."""
        evaluations = 4 * self._substeps
        after, jacobian = np.empty(6), np.empty((6, 8))
        linearise(
            self._parameters, state, thrusts, self.step_s, self._substeps, after, jacobian,
            np.empty((evaluations, 4, 8)), np.empty((evaluations, 4)),
            np.empty((evaluations, 6, 8)),
        )  # fmt: skip
        return float(np.linalg.norm(jacobian[[0, 1, 3], 4:6], 2))

    def _outward_states(self) -> Array:
        """States in the middle of each side, heading straight out, at both ends of the window."""
        points = np.asarray(self.target.vertices)
        middles = 0.5 * (points + np.roll(points, -1, axis=0))
        states: list[list[float]] = []
        for north, east in middles.tolist():
            side = int(np.argmax(self._rows[:-2, :2] @ [north, east] - self._rows[:-2, 3]))
            out_north, out_east = self._rows[side, :2].tolist()
            heading = math.atan2(out_east, out_north)
            # Slightly inside, so that rounding does not decide whether the set holds the state.
            place = [north - 1e-9 * out_north, east - 1e-9 * out_east]
            window = (self.target.speed_min_mps, self.target.speed_max_mps)
            states += [[*place, heading, speed, 0.0, 0.0] for speed in window]
        return np.array(states)

    def _spread_states(self, bounds: FreeBounds, count: int, seed: int) -> Array:
        points = np.asarray(self.target.vertices)
        turn = np.array([bounds.sway_mps, bounds.yaw_rate_radps])
        low = np.array([*points.min(axis=0), -math.pi, self.target.speed_min_mps, *-turn])
        high = np.array([*points.max(axis=0), math.pi, self.target.speed_max_mps, *turn])
        sequence = qmc.Sobol(6, rng=seed).random_base2(math.ceil(math.log2(max(count, 2))))
        states = low + sequence * (high - low)
        return states[[self.target.covers(x, y) for x, y in states[:, :2].tolist()]]


def _grid(low: float, high: float, count: int) -> Array:
    """All pairs of `count` values from `low` to `high`: (count^2, 2)."""
    values = np.linspace(low, high, count)
    return np.stack(np.meshgrid(values, values, indexing="ij"), axis=-1).reshape(-1, 2)
