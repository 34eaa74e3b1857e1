"""Import matplotlib without the documentation it generates for the settings of its artists. That
takes a third of the import's time, and no picture needs it.
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
    """Suppress this documentation within the context; artists defined later have theirs."""
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
    """Import what draws figures, unless it has been imported already."""
    if "matplotlib.figure" in sys.modules:
        return
    with _undescribed():
        importlib.import_module("matplotlib.figure")
