"""Rules and solvers by the names that front ends and recorded missions give them.

This is the only table of names: the controller itself takes values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.control.solvers.base import SolverBuilder
from grebe.control.solvers.builders import Fast, Fatrop, Ipopt
from grebe.core.errors import UsageError
from grebe.workflow.own_files import OWN, function_of

_T = TypeVar("_T")
# Settings of the built-in rules.
NUMBERS = ("stages", "step_s", "epsilon", "alpha", "beta", "p", "q", "thrift")

RULES: Mapping[str, type[Single | Dual | Lookahead]] = {
    "single": Single,
    "dual": Dual,
    "lookahead": Lookahead,
}
SOLVERS: Mapping[str, type[Fast | Fatrop | Ipopt]] = {
    "fast": Fast,
    "fatrop": Fatrop,
    "ipopt": Ipopt,
}


def rule_named(name: str, settings: Mapping[str, Any] | None = None) -> Rule:
    """Return the rule of that name with its own defaults, except for `settings`.

    `python:FILE.py` names the rule that a user's own file makes. Settings that are None, and those
    that the rule does not have, are ignored: a record holds what was typed for any rule. Raises
    `UsageError` for an unknown name or an impossible value.
    """
    if name.startswith(OWN):
        typed = [key for key in NUMBERS if (settings or {}).get(key) is not None]
        if typed:
            raise UsageError(f"{name} has settings of its own; set {', '.join(typed)} in the file.")
        return _own_rule(Path(name.removeprefix(OWN)))
    chosen = _choice("rule", name, RULES)
    own = {field.name for field in fields(chosen)}
    given = {k: v for k, v in (settings or {}).items() if k in own and v is not None}
    return chosen(**given)


def _own_rule(path: Path) -> Rule:
    """Return what the function `rule` of a Python file returns."""
    try:
        found: Any = function_of(path, "rule", UsageError)()
    except UsageError:
        raise
    except Exception as wrong:
        text = f"{type(wrong).__name__}: {wrong}"
        raise UsageError(f"{OWN}{path}: rule() fails ({text}).") from wrong
    needed = ("propose", "stages", "step_s", "longest_stage_s")
    lacks = [one for one in needed if not hasattr(found, one)]
    if lacks or isinstance(found, type):
        lacking = f"; it lacks {', '.join(lacks)}" if lacks else ", but a class of them"
        raise UsageError(f"{OWN}{path}: rule() does not return a rule{lacking}.")
    return cast("Rule", found)


def solver_named(name: str) -> SolverBuilder:
    """Return the solver of that name; raises `UsageError` for an unknown one."""
    return _choice("solver", name, SOLVERS)()


def _choice(what: str, name: str, table: Mapping[str, _T]) -> _T:
    if name not in table:
        raise UsageError(f"There is no {what} {name!r}; choose one of {', '.join(table)}.")
    return table[name]
