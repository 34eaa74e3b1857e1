"""Compile the controller's kernels once, in a process of their own.

A kernel that is compiled in the process that runs it may round its last digit otherwise than the
same kernel loaded from the cache: what is inlined differs. So the first mission after installation
would differ from all later ones. It does not where every mission loads from the cache.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from grebe.core import kernels

_COMMAND = "from grebe.workflow.warm import sail_a_little; sail_a_little()"


def compile_controller() -> bool:
    """Fill the cache where it is empty and can be written; return whether it is filled now."""
    if not kernels.is_compiled() and os.access(Path(kernels.__file__).parent, os.W_OK):
        subprocess.run([sys.executable, "-c", _COMMAND], check=False, capture_output=True)
    return kernels.is_compiled()


def sail_a_little() -> None:
    """Sail through two sets: it needs every kernel that a mission needs."""
    from grebe.control.controller import Controller
    from grebe.core.vessel import PRESETS
    from grebe.mission.trial import Conditions, fly, meander

    boat, sets = PRESETS["spyboat"], meander(rows=1, columns=2)
    fly(boat, sets, Controller(boat, sets), (-5.0, 2.0, 0, 0, 0, 0), Conditions(limit_s=20.0))
