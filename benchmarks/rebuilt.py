"""What a researcher writes first: the paper's problem with hard sets, built anew each step.

CasADi Opti with IPOPT, with the model a function that is made once: problem (8) with the
constraints on x_{N_x} and x_N as printed, and the same vessel, weights and integration as Grebe's
`dual`. It is the baseline of all ratios and shares no code with Grebe's solvers.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from benchmarks.common import told
from grebe.control.controller import Margins
from grebe.control.rules.dual import Dual
from grebe.control.rules.split import split_stage
from grebe.core.dynamics import rates, rk4


class RebuiltPilot:
    def __init__(self, vessel, targets, rule: Dual, substeps: int) -> None:
        self.vessel, self.targets, self.rule = vessel, targets, rule
        self.step_s = rule.step_s
        self.aims = [t.shrunk(Margins().set_m, Margins().speed_mps) for t in targets]
        self.guess, self.reached = None, 0
        z, inputs = ca.SX.sym("z", 6), ca.SX.sym("F", 2)
        after = rk4(
            lambda s: rates(vessel, s, ca.vertsplit(inputs), cos=ca.cos, sin=ca.sin),
            ca.vertsplit(z),
            self.step_s,
            substeps,
        )
        self.model = ca.Function("model", [z, inputs], [ca.vertcat(*after)])

    def step(self, state, weather, elapsed_s):
        reached = self.reached
        n, vessel, rule = self.rule.stages, self.vessel, self.rule
        distance = self.targets[reached].distance(state)
        split = split_stage(distance, rule.epsilon, n)
        current = self.aims[reached].halfspaces
        following = self.aims[reached + 1].halfspaces if reached + 1 < len(self.aims) else None
        opti = ca.Opti()
        x, f = opti.variable(6, n + 1), opti.variable(2, n)
        opti.subject_to(x[:, 0] == np.asarray(state))
        opti.subject_to(opti.bounded(vessel.thrust_min_n, ca.vec(f), vessel.thrust_max_n))
        cost = 0
        for k in range(n):
            opti.subject_to(x[:, k + 1] == self.model(x[:, k], f[:, k]))
            rows = current if k < split else following
            if rows is not None:
                outside = ca.fmax(rows[:, :3] @ x[[0, 1, 3], k] - rows[:, 3], 0)
                cost += rule.alpha * ca.sumsqr(outside)
            cost += rule.beta * ca.sumsqr(f[:, k] / vessel.thrust_max_n)
        if split > 0:
            opti.subject_to(current[:, :3] @ x[[0, 1, 3], split] <= current[:, 3])
        if following is not None and split < n:
            opti.subject_to(following[:, :3] @ x[[0, 1, 3], n] <= following[:, 3])
        opti.minimize(cost)
        opti.solver(
            "ipopt",
            {"print_time": False},
            {"print_level": 0, "sb": "yes", "max_iter": 300},
        )
        if self.guess is not None:
            opti.set_initial(x, np.hstack([self.guess[0][:, 1:], self.guess[0][:, -1:]]))
            opti.set_initial(f, np.hstack([self.guess[1][:, 1:], self.guess[1][:, -1:]]))
        try:
            opti.solve()
            solved, read = True, opti.value
        except RuntimeError:
            solved, read = False, opti.debug.value
        states, thrusts = np.array(read(x)), np.array(read(f))
        self.guess = (states, thrusts) if solved else None
        first = tuple(np.clip(thrusts[:, 0], vessel.thrust_min_n, vessel.thrust_max_n).tolist())
        return told(first, reached, solved=solved)
