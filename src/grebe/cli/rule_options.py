"""Options of the controller: its rule, its solver, and their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

from grebe.cli import options
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.core.errors import UsageError
from grebe.workflow.steering_names import RULES, SOLVERS, rule_named, solver_named

WITH_DEFAULTS = {name: kind() for name, kind in RULES.items()}
WEIGHTS = {
    "epsilon": "Distance to the current set within which the next set counts (Definition 8)",
    "alpha": "Weight of the squared distance (Eq. 2)",
    "beta": "Weight of the squared thrusts (Eq. 2)",
    "p": "Weight of the current set (Eq. 7)",
    "q": "Weight of the next set (Eq. 7)",
    "thrift": "Cost of a second of one thruster at full thrust, in seconds of mission time; 0.5 "
    "takes about a tenth more time and less energy",
}


def _with_defaults(name: str, what: str) -> str:
    """A weight's help text, with the default of each rule."""
    told = {rule: getattr(one, name, None) for rule, one in WITH_DEFAULTS.items()}
    return f"{what} [{', '.join(f'{k} {v:g}' for k, v in told.items() if v is not None)}]."


rule_options = options.together(
    click.option(
        "--rule",
        default="lookahead",
        show_default=True,
        help=f"The rule that plans: {', '.join(RULES)}, or python:FILE.py for one of your own.",
    ),
    click.option(
        "--solver",
        type=click.Choice(list(SOLVERS)),
        default="fast",
        show_default=True,
        help="The solver.",
    ),
    click.option("--horizon", type=int, help="Stages of the horizon, N [lookahead 24, else 15]."),
    click.option(
        "--step", "step_s", type=float, help="Time between solves, T [s] [lookahead 0.5, else 1]."
    ),
    *(
        click.option(f"--{name}", type=float, help=_with_defaults(name, what))
        for name, what in WEIGHTS.items()
    ),
)


def refuse_foreign(rule: str, typed: Mapping[str, Any]) -> None:
    """Raise `UsageError` for a typed parameter that the rule does not have."""
    for name in WEIGHTS:
        theirs = [known for known, one in WITH_DEFAULTS.items() if hasattr(one, name)]
        if typed.get(name) is not None and rule in RULES and rule not in theirs:
            have = f"{' and '.join(theirs)} {'have' if len(theirs) > 1 else 'has'} it"
            raise UsageError(f"--{name} is not a setting of the rule {rule}; {have}.")


def typed_again(run: Mapping[str, Any]) -> str:
    """The controller's options as they were typed, for the next command."""
    options = {"rule": "lookahead", "solver": "fast", "horizon": None, "step_s": None}
    options |= dict.fromkeys(WEIGHTS)
    typed = {name: run[name] for name, usual in options.items() if run[name] != usual}
    return "".join(f" --{name.removesuffix('_s')} {value}" for name, value in typed.items())


def rule_of(run: dict[str, Any]) -> tuple[Rule, SolverBuilder]:
    """The rule and the solver given by the options."""
    return rule_named(run["rule"], run | {"stages": run["horizon"]}), solver_named(run["solver"])
