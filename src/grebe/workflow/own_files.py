"""Functions that a user's own Python file defines: a boat, a rule."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

from grebe.core.errors import GrebeError

# The prefix of the name of something that a user's own file defines.
OWN = "python:"


def function_of(path: Path, name: str, error: type[GrebeError]) -> Callable[..., Any]:
    """Return the function of that name in a file; `error` says what is wrong with the file."""
    what = f"{OWN}{path}"
    if not path.is_file():
        raise error(f"{what}: there is no such file.")
    try:
        found = runpy.run_path(str(path)).get(name)
    except (Exception, SyntaxError) as wrong:
        raise error(f"{what}: the file cannot be run ({type(wrong).__name__}: {wrong}).") from wrong
    if not callable(found):
        raise error(f"{what}: the file defines no function {name}.")
    return found
