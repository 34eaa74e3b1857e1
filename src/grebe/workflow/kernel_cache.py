"""Compile the controller's kernels once, in a separate process.

A kernel that is compiled in the process that runs it may differ in the last bit from the same
kernel loaded from the cache, because inlining differs. The first mission after installation would
thus differ from all later ones. It does not if every mission loads from the cache.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from grebe.core import kernels
from grebe.workflow.garbage_collection import without_collection

if TYPE_CHECKING:
    from grebe.control.controller import Command
    from grebe.core.dynamics import Weather
    from grebe.core.events import State
    from grebe.core.vessel import Vessel

_CALL = "from grebe.workflow.kernel_cache import {0}; {0}()"
COMPILE, BESIDE = _CALL.format("compile_all"), _CALL.format("compile_beside")


def compile_controller() -> bool:
    """Fill the cache if it is not full and can be written; return whether it is full now."""
    if not kernels.is_compiled() and os.access(Path(kernels.__file__).parent, os.W_OK):
        kernels.forget_compiled()
        subprocess.run([sys.executable, "-c", COMPILE], check=False, capture_output=True)
    return kernels.is_compiled()


@without_collection()
def compile_all() -> None:
    """Compile everything that a mission needs.

    If there is a second core, a second process does its share. Whatever it does not do, for any
    reason, is done here.
    """
    from grebe.control.solvers.fast.ahead import compile_horizon, compile_optimise

    if (os.cpu_count() or 1) > 1:
        with subprocess.Popen([sys.executable, "-c", BESIDE], stdout=subprocess.PIPE) as beside:
            compile_horizon()
            assert beside.stdout is not None
            beside.stdout.readline()
            compile_optimise()
    sail_a_little()
    kernels.note_compiled()


@without_collection()
def compile_beside() -> None:
    """Do the second process's share.

    It reports when the solver can be put together, and goes on with what a mission needs besides
    the solver.
    """
    from grebe.control.solvers.fast.ahead import compile_quadratic

    compile_quadratic()
    sys.stdout.write("The quadratic problem is compiled.\n")
    sys.stdout.flush()
    sail_a_little(steered=False)


@cache
def load_controller() -> None:
    """Load all kernels that missions need, always in the same order.

    Two kernels that call a third each have a copy of it, and the copies may differ in the last bit;
    of all copies a process runs the one that it loaded first. If kernels were loaded as they happen
    to be needed, a mission would depend on what the process has sailed before.
    """
    sail_a_little()


def sail_a_little(*, steered: bool = True) -> None:
    """Sail a boat with weak and late thrusters by noisy estimates.

    It sails for longer than it takes to detect them, which needs every kernel that a mission may
    need, even in its middle. With `steered=False` it needs all but the solver's.
    """
    from grebe.control.controller import Controller
    from grebe.core.sets import footprints_of
    from grebe.core.taut import taut_path
    from grebe.core.vessel import PRESETS
    from grebe.links.simulated import EstimateErrors
    from grebe.mission.trial import Conditions, meander, simulate

    model, sets = PRESETS["spyboat"], meander(rows=3, columns=4)
    late = Conditions(
        boat=replace(model, thruster_lag_s=1.0),
        effectiveness=(0.5, 0.5),
        errors=EstimateErrors(velocity_mps=0.02),
        limit_s=30.0,
    )
    helm = Controller(model, sets) if steered else _Weaving(model)
    simulate(model, sets, helm, (-5.0, 2.0, 0, 0, 0, 0), late)
    # Only large cells need this kernel.
    taut_path((-5.0, 2.0), footprints_of(sets))


class _Weaving:
    """A helm that turns the boat one way and then the other."""

    reached = 0
    step_s = 1.0

    def __init__(self, vessel: Vessel) -> None:
        self.vessel = vessel
        self._steps = 0

    def take_for(self, vessel: Vessel) -> None:
        self.vessel = vessel

    def step(self, state: State, weather: Weather, elapsed_s: float | None) -> Command:  # noqa: ARG002
        from grebe.control.controller import Command

        self._steps += 1
        full = self.vessel.thrust_max_n
        left = self._steps % 6 < 3
        return Command(thrusts=(full, 0.2 * full) if left else (0.2 * full, full))
