"""Peers: a ground station's usual guidance, and set-point NMPC on the cells' centres."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.common import told
from grebe.control.rules.base import Decision, Proposal, Situation, shifted
from grebe.control.rules.split import fixed_steps


class LineOfSightPilot:
    """Waypoints at the cells' centres, line-of-sight guidance (Fossen 2011, sec. 10.3), PID.

    With `stopping` the boat brakes at each waypoint and turns on the spot, as an autopilot in
    its waypoint mode does. A waypoint counts as passed within the acceptance radius; whether
    the set was reached is judged, as for everybody, by the state.
    """

    step_s = 0.2
    ACCEPTANCE_M = 1.0
    LOOKAHEAD_M = 4.0

    def __init__(self, vessel, targets, *, stopping: bool) -> None:
        self.vessel, self.stopping = vessel, stopping
        self.targets = targets
        self.speed = 0.5 * (targets[0].speed_min_mps + targets[0].speed_max_mps)
        self.integral = 0.0
        self.previous = None
        self.reached, self.heading_for = 0, -1

    def step(self, state, weather, elapsed_s):
        reached = self.reached
        if reached != self.heading_for:
            self.previous = self.targets[reached - 1].centre if reached else tuple(state[:2])
            self.heading_for = reached
        course = self._course(state, self.targets[reached].centre)
        off = math.remainder(course - state[2], 2 * math.pi)
        wanted = self.speed * max(0.0, math.cos(off))
        if self.stopping and abs(off) > math.radians(15):
            wanted = 0.0
        error = wanted - state[3]
        self.integral = float(np.clip(self.integral + 0.5 * error * self.step_s, -2, 2))
        common = 0.5 * self.vessel.surge_drag_n(wanted)
        common += self.vessel.m11_kg * 0.5 * (error + self.integral)
        rate = self.vessel.m33_kgm2 * (1.5 * off - 2.0 * state[5]) / (2 * self.vessel.arm_m)
        low, high = self.vessel.thrust_min_n, self.vessel.thrust_max_n
        thrusts = (
            float(np.clip(common + rate, low, high)),
            float(np.clip(common - rate, low, high)),
        )
        return told(thrusts, reached)

    def _course(self, state, goal) -> float:
        (x0, y0), (x1, y1) = self.previous, goal
        path = math.atan2(y1 - y0, x1 - x0)
        cross = -(state[0] - x0) * math.sin(path) + (state[1] - y0) * math.cos(path)
        beyond = (state[0] - x1) * math.cos(path) + (state[1] - y1) * math.sin(path)
        if beyond > -self.ACCEPTANCE_M or math.dist((x0, y0), goal) < 0.1:
            return math.atan2(y1 - state[1], x1 - state[0])
        return path + math.atan2(-cross, self.LOOKAHEAD_M)


@dataclass(frozen=True, kw_only=True)
class SetPoint:
    """Set-point NMPC: the squared distance to the centre of the current set alone."""

    alpha: float = 1.0
    beta: float = 0.4
    stages: int = 15
    step_s: float = 1.0
    longest_stage_s: float = 1.0

    def propose(self, situation: Situation, shape) -> Proposal:
        horizon = fixed_steps(shape, self.step_s, self.beta, shape.stages, self.beta)
        aim = situation.aims[0]
        north, east = aim.centre
        speed = 0.5 * (aim.speed_min_mps + aim.speed_max_mps)
        point = np.array(
            [[1, 0, 0, north], [-1, 0, 0, -north], [0, 1, 0, east], [0, -1, 0, -east],
             [0, 0, 1, speed], [0, 0, -1, -speed]], dtype=float
        )  # fmt: skip
        for stage in range(shape.stages):
            horizon.attract(stage, point, self.alpha)
        decision = Decision(target=situation.target, split=shape.stages)
        return Proposal(horizon=horizon, decision=decision, start=shifted(situation))
