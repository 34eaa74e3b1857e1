"""The options of who steers: the rule that plans, the solver, and their numbers."""

from __future__ import annotations

from typing import Any

import click

from grebe.cli import options
from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.solvers.base import SolverBuilder
from grebe.workflow.steering_names import RULES, SOLVERS, rule_named, solver_named

DEFAULTS = Dual()
WEIGHTS = {
    "alpha": "Weight of the squared distance (Eq. 2), for single and dual.",
    "beta": "Weight of the squared thrusts (Eq. 2), for single and dual.",
    "p": "Weight of the current set (Eq. 7), for dual.",
    "q": "Weight of the next set (Eq. 7), for dual.",
}


rule_options = options.together(
    click.option(
        "--rule",
        type=click.Choice(list(RULES)),
        default="lookahead",
        show_default=True,
        help="Who plans.",
    ),
    click.option(
        "--solver",
        type=click.Choice(list(SOLVERS)),
        default="fast",
        show_default=True,
        help="Who solves.",
    ),
    click.option("--horizon", type=int, help="N, in stages [lookahead 24, else 15]."),
    click.option("--step", "step_s", type=float, help="T [s] [lookahead 0.5, else 1]."),
    click.option(
        "--epsilon",
        type=float,
        default=DEFAULTS.epsilon,
        show_default=True,
        help="For single and dual: from how far off the next set counts (Definition 8).",
    ),
    *(
        click.option(
            f"--{name}", type=float, default=getattr(DEFAULTS, name), show_default=True, help=what
        )
        for name, what in WEIGHTS.items()
    ),
)


def rule_of(run: dict[str, Any]) -> tuple[Rule, SolverBuilder]:
    """The rule and the solver that were asked for."""
    return rule_named(run["rule"], run | {"stages": run["horizon"]}), solver_named(run["solver"])
