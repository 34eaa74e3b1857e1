"""Compile the controller's kernels once, in a process of their own.

A kernel that is compiled in the process that runs it may round its last digit otherwise than the
same kernel loaded from the cache: what is inlined differs. So the first mission after installation
would differ from all later ones. It does not where every mission loads from the cache.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from grebe.core import kernels
from grebe.workflow.collector import uncollected

COMPILE = "from grebe.workflow.kernel_cache import sail_a_little; sail_a_little()"


def compile_controller() -> bool:
    """Fill the cache where it is not full and can be written; return whether it is full now."""
    if not kernels.is_compiled() and os.access(Path(kernels.__file__).parent, os.W_OK):
        kernels.forget_compiled()
        subprocess.run([sys.executable, "-c", COMPILE], check=False, capture_output=True)
    return kernels.is_compiled()


@uncollected()
def sail_a_little() -> None:
    """Sail a boat with weak and late thrusters by noisy estimates, for longer than it takes to find
    that out: every kernel is needed then that a mission may need, also in its middle.
    """
    from grebe.control.controller import Controller
    from grebe.core.sets import footprints_of
    from grebe.core.taut import taut_way
    from grebe.core.vessel import PRESETS
    from grebe.links.simulated import EstimateErrors
    from grebe.mission.trial import Conditions, fly, meander

    model, sets = PRESETS["spyboat"], meander(rows=3, columns=4)
    late = Conditions(
        boat=replace(model, thruster_lag_s=1.0),
        effectiveness=(0.5, 0.5),
        errors=EstimateErrors(velocity_mps=0.02),
        limit_s=30.0,
    )
    fly(model, sets, Controller(model, sets), (-5.0, 2.0, 0, 0, 0, 0), late)
    # Large cells alone ask for it.
    taut_way((-5.0, 2.0), footprints_of(sets))
    kernels.note_compiled()
