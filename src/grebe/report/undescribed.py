"""Import matplotlib without the descriptions that it writes of each of its artists' settings: a
third of the time that its import takes, for documentation that no picture needs.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, cast

import matplotlib.artist


@contextmanager
def _undescribed() -> Generator[None]:
    """Describe none of the artists that are made meanwhile; those of a user's own are, later on."""
    artist, name = cast("Any", matplotlib.artist.Artist), "_update_set_signature_and_docstring"
    describe = vars(artist).get(name)
    if describe is None:
        yield
        return
    setattr(artist, name, classmethod(lambda _: None))
    try:
        yield
    finally:
        setattr(artist, name, describe)


def import_figures() -> None:
    """Import what draws figures, unless somebody has already."""
    if "matplotlib.figure" in sys.modules:
        return
    with _undescribed():
        importlib.import_module("matplotlib.figure")
