"""Rules and solvers by the names that front ends and recorded missions give them.

The controller itself takes values and knows no names: this is the one table of them.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.control.solvers.base import SolverBuilder
from grebe.control.solvers.builders import Fast, Fatrop, Ipopt
from grebe.core.errors import UsageError

_T = TypeVar("_T")
# How the name of a rule in a file of one's own begins.
OWN = "python:"

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
    """Return the rule of that name with its own defaults, but for `settings`; or that of a user's
    own file, `python:FILE.py`, as it makes it.

    Settings that are None, and those that the rule does not have, are passed over: a record holds
    what was typed for any rule. Raises `UsageError` for an unknown name or an impossible value.
    """
    if name.startswith(OWN):
        return _own_rule(name, Path(name.removeprefix(OWN)))
    chosen = _choice("rule", name, RULES)
    own = {field.name for field in fields(chosen)}
    given = {k: v for k, v in (settings or {}).items() if k in own and v is not None}
    return chosen(**given)


def _own_rule(name: str, path: Path) -> Rule:
    """What the function `rule` of a Python file returns."""
    if not path.is_file():
        raise UsageError(f"{name}: there is no such file.")
    made: Callable[[], Rule] | None = runpy.run_path(str(path)).get("rule")
    if not callable(made):
        raise UsageError(f"{name}: the file defines no function rule() that returns a rule.")
    found: Any = made()
    lacks = [
        one for one in ("propose", "stages", "step_s", "longest_stage_s") if not hasattr(found, one)
    ]
    if lacks:
        raise UsageError(f"{name}: what rule() returns is no rule: it lacks {', '.join(lacks)}.")
    return found


def solver_named(name: str) -> SolverBuilder:
    """Return the solver of that name; raises `UsageError` for an unknown one."""
    return _choice("solver", name, SOLVERS)()


def _choice(what: str, name: str, table: Mapping[str, _T]) -> _T:
    if name not in table:
        raise UsageError(f"There is no {what} {name!r}; choose one of {', '.join(table)}.")
    return table[name]
