"""Kernels are compiled, and loaded from disk, without interruption."""

import os
import signal
import subprocess
import sys

import pytest

from grebe.core import kernels
from grebe.core.kernels import machine_code, part_of_kernels, signals_held_back

KILLED_WHILE_COMPILING = """
import signal, sys
from numba.core.codegen import CPUCodeLibrary as Library
from grebe.core import kernels

# Whenever the compiler calls back, where an exception would be lost.
def interrupted(name):
    call = getattr(Library, name).__func__
    def callback(cls, *given):
        signal.raise_signal(signal.SIGINT)
        return call(cls, *given)
    setattr(Library, name, classmethod(callback))

interrupted("_object_compiled_hook")
interrupted("_object_getbuffer_hook")

@kernels.machine_code
def doubled(x):
    return 2 * x

try:
    doubled(1.0)
except KeyboardInterrupt:
    sys.exit(0 if doubled(2.0) == 4.0 else 3)
sys.exit(4)
"""


def interrupted_in(depth, done):
    with signals_held_back():
        if depth > 0:
            interrupted_in(depth - 1, done)
        else:
            os.kill(os.getpid(), signal.SIGINT)
        done.append(depth)


@pytest.fixture(autouse=True)
def _interruptible():
    """Restore the default handler: tests started in the background may ignore SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("depth", [0, 2])
def test_a_signal_is_handled_after_what_must_not_be_interrupted(depth):
    """In nested calls, it is handled after the outermost."""
    done = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_in(depth, done)
    assert done == list(range(depth + 1))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interruption_while_machine_code_is_made_neither_kills_nor_is_lost(tmp_path):
    """It used to crash the process: the compiler's callbacks into Python lose an exception."""
    script = tmp_path / "script.py"
    script.write_text(KILLED_WHILE_COMPILING)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    # And where the machine code is found on disk.
    again = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=120, check=False
    )
    assert again.returncode == 0, again.stderr


INTERPRETED = """
import numpy as np
from grebe.control.solvers.fast.riccati import factorise, solve
n = 2
hess = np.tile(np.eye(9, 10), (n, 1, 1))
sens, grad = np.ones((n, 6, 8)) * 0.1, np.ones((n, 10))
sens[:, :, 7] = 0.0
p, gain, chol = np.zeros((n + 1, 6, 8)), np.zeros((n, 3, 8)), np.zeros((n, 3, 3))
assert factorise(hess, np.eye(6), sens, p, gain, chol)
dx, dw, costate = np.zeros((n + 1, 6)), np.zeros((n, 3)), np.zeros((n + 1, 6))
solve(grad, np.ones(6), sens, np.ones((n, 6)), p, gain, chol, dx, dw, costate)
print(repr(float(dx.sum() + dw.sum() + costate.sum())))
"""


def test_kernels_run_without_the_compiler_and_find_the_same():
    """In Python they can be stepped through with a debugger."""
    told = [
        subprocess.run(
            [sys.executable, "-c", INTERPRETED],
            env=os.environ | switched,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for switched in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert float(told[0]) == pytest.approx(float(told[1]), rel=1e-12)


@part_of_kernels
def _doubled(x):
    return 2 * x


@machine_code
def _doubled_twice(x):
    return _doubled(_doubled(x))


def test_a_part_of_kernels_is_refused_to_python_before_and_after_it_is_compiled():
    """It has no entry point for Python: a call would crash the process."""
    with pytest.raises(TypeError, match="_doubled can only be called from other kernels"):
        _doubled(1.0)
    assert _doubled_twice(1.0) == 4.0
    with pytest.raises(TypeError, match="_doubled can only be called from other kernels"):
        _doubled(1.0)


WRITTEN_AT_ONCE = """
import sys, time
from grebe.core import kernels
from grebe.core.kernels import _save_alone

class Cache:
    cache_path = sys.argv[1]
    def save_overload(self, signature, compiled):
        print("begins", flush=True)
        time.sleep(0.3)
        print("ends", flush=True)

class Kernel:
    _cache = Cache()

_save_alone(Kernel)
sys.stdin.readline()
Kernel._cache.save_overload(None, None)
"""


def test_two_processes_write_machine_code_one_after_the_other(tmp_path):
    """Otherwise both would give their files one number, with machine code for other arguments."""
    told = tmp_path / "told"
    with told.open("w") as out:
        both = [
            subprocess.Popen(
                [sys.executable, "-c", WRITTEN_AT_ONCE, str(tmp_path / "cache")],
                stdin=subprocess.PIPE, stdout=out,
            )
            for _ in range(2)
        ]  # fmt: skip
        for one in both:
            one.stdin.write(b"go\n")
            one.stdin.flush()
        for one in both:
            one.communicate(timeout=120)
    assert told.read_text().split() == ["begins", "ends"] * 2


def test_without_a_folder_to_write_to_nobody_waits(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with kernels._alone(tmp_path / "file" / "cache"):
        pass
