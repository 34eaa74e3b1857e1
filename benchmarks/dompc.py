"""The paper's dual-mode problem as a user of do-mpc would pose it.

do-mpc builds its problem once and takes the rest as time-varying parameters: the set that each
stage's cost measures, and the set that must hold a stage, softened as do-mpc offers it. Its
constraints are on the stages 0 to N - 1, so the constraint on x_N is imposed at stage N - 1.
"""

from __future__ import annotations

import warnings

import casadi as ca
import numpy as np

from benchmarks.common import told
from grebe.control.controller import Margins
from grebe.control.rules.dual import Dual
from grebe.control.rules.split import split_stage
from grebe.core.dynamics import rates, rk4

FAR = 1e6
OPEN = np.array([[0.0, 0.0, 0.0, FAR]] * 6)


class DoMpcPilot:
    def __init__(self, vessel, targets, rule: Dual, substeps: int) -> None:
        self.targets, self.rule, self.step_s = targets, rule, rule.step_s
        self.aims = [t.shrunk(Margins().set_m, Margins().speed_mps) for t in targets]
        self.costed = [OPEN] * (rule.stages + 1)
        self.held = [OPEN] * (rule.stages + 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.mpc = self._built(vessel, rule, substeps)
        self.begun, self.reached, self.vessel = False, 0, vessel

    def _built(self, vessel, rule, substeps):
        import do_mpc

        model = do_mpc.model.Model("discrete", "SX")
        z = model.set_variable("_x", "z", (6, 1))
        thrusts = model.set_variable("_u", "F", (2, 1))
        costed = model.set_variable("_tvp", "costed", (24, 1))
        held = model.set_variable("_tvp", "held", (24, 1))
        after = rk4(
            lambda s: rates(vessel, s, ca.vertsplit(thrusts), cos=ca.cos, sin=ca.sin),
            ca.vertsplit(z),
            rule.step_s,
            substeps,
        )
        model.set_rhs("z", ca.vertcat(*after))
        model.setup()
        mpc = do_mpc.controller.MPC(model)
        mpc.set_param(
            n_horizon=rule.stages,
            t_step=rule.step_s,
            store_full_solution=False,
            nlpsol_opts={"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0},
        )
        outside = ca.fmax(_excess(costed, z), 0)
        effort = ca.sumsqr(thrusts / vessel.thrust_max_n)
        mpc.set_objective(
            mterm=ca.SX(0), lterm=rule.alpha * ca.sumsqr(outside) + rule.beta * effort
        )
        mpc.set_rterm(F=0.0)
        mpc.bounds["lower", "_u", "F"] = vessel.thrust_min_n
        mpc.bounds["upper", "_u", "F"] = vessel.thrust_max_n
        mpc.set_nl_cons(
            "held", _excess(held, z), ub=0, soft_constraint=True,
            penalty_term_cons=rule.entry_penalty,
        )  # fmt: skip
        template = mpc.get_tvp_template()

        def parameters(_):
            for k in range(rule.stages + 1):
                template["_tvp", k, "costed"] = self.costed[k].ravel()
                template["_tvp", k, "held"] = self.held[k].ravel()
            return template

        mpc.set_tvp_fun(parameters)
        mpc.setup()
        return mpc

    def step(self, state, weather, elapsed_s):
        reached = self.reached
        n = self.rule.stages
        split = split_stage(self.targets[reached].distance(state), self.rule.epsilon, n)
        current = self.aims[reached].halfspaces
        last = reached + 1 == len(self.aims)
        following = OPEN if last else self.aims[reached + 1].halfspaces
        self.costed = [current if k < split else following for k in range(n + 1)]
        self.held = [OPEN] * (n + 1)
        if split > 0:
            self.held[min(split, n - 1)] = current
        if split < n - 1:
            self.held[n - 1] = following
        z = np.asarray(state, dtype=float).reshape(-1, 1)
        if not self.begun:
            self.mpc.x0 = z
            self.mpc.set_initial_guess()
            self.begun = True
        port, starboard = self.mpc.make_step(z).ravel().tolist()
        return told((port, starboard), reached, solved=bool(self.mpc.solver_stats["success"]))


def _excess(rows, z):
    matrix = ca.reshape(rows, 4, 6).T
    return matrix[:, :3] @ ca.vertcat(z[0], z[1], z[3]) - matrix[:, 3]
