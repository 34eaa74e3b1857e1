"""How the numerical kernels are compiled: by numba, once, and kept on disk."""

from __future__ import annotations

import fcntl
import hashlib
import importlib
import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, ParamSpec, TypeVar

import numba

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")

# Sums may be reordered and multiplications fused. NaN and infinity keep their meaning: the
# solver tests for them.
_FASTMATH = {"contract", "reassoc", "arcp", "nsz"}

_PACKAGE = Path(__file__).parents[1]
# Where a mission's kernels are written, and the file that says that all of them are compiled.
_OF_MISSIONS = ("core", "control", "mission", "links")
_STAMP = _PACKAGE / "core" / "__pycache__" / "missions_are_compiled"


def machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Turn a kernel into machine code at its first call; later processes load it from disk.

    While it runs, other threads do too: the one that ends a command when it is told to.
    """
    return _compiled(function, fastmath=_FASTMATH, nogil=True)


def exact_machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `machine_code`, but every sum in the order in which it is written: for kernels whose
    rounding is part of the method.
    """
    return _compiled(function, nogil=True)


def part_of_kernels(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `machine_code`, for what other kernels call and Python never does: what would unpack
    Python's arguments is not compiled. Called by Python it raises `TypeError`.
    """
    return _hidden(_compiled(function, fastmath=_FASTMATH, no_cpython_wrapper=True))


def inlined_machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `part_of_kernels`, copied into each kernel that calls it. For small kernels: handing
    over a record of arrays takes longer than they do.
    """
    options = {"no_cpython_wrapper": True, "forceinline": True}
    return _hidden(_compiled(function, fastmath=_FASTMATH, **options))


def _compiled(function: Callable[_Arguments, _Result], **options: Any) -> Any:
    # Nobody calls a kernel from C.
    options = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True} | options
    return _compiled_in_peace(numba.njit(**options)(function))


def _hidden(kernel: Any) -> Any:
    """Keep Python from calling a kernel that it has no way into: it would jump to nowhere."""
    if not hasattr(kernel, "compile"):
        return kernel  # With NUMBA_DISABLE_JIT=1 it is Python's own function.

    def refuse(*_: Any, **__: Any) -> None:
        raise TypeError(f"{kernel.__name__} is a part of other kernels: Python cannot call it")

    # What numba knows of ways in, and asks for one where it knows of none.
    kernel._insert = lambda *_: None
    kernel._compile_for_args = refuse
    return kernel


def _compiled_in_peace(kernel: Any) -> Any:
    """Let nothing interrupt a kernel's compilation, or its loading from disk. An exception that a
    signal raises within a call back from the compiler is lost there, and the machine code with it:
    the process then dies of it.
    """
    if not hasattr(kernel, "compile"):
        return kernel  # With NUMBA_DISABLE_JIT=1 numba hands the function back as it is.
    _load_at_once(kernel)
    _save_alone(kernel)
    compile_once = kernel.compile

    def compile_in_peace(signature: Any) -> Any:
        with signals_held_back():
            return compile_once(signature)

    kernel.compile = compile_in_peace
    return kernel


def _load_at_once(kernel: Any) -> None:
    """Load a kernel's machine code without what only a compiler needs: numba first tells its
    compiler of all that it could translate, for a tenth of a second and more. Where that is not on
    disk, or another numba is built otherwise, it goes numba's own way.
    """
    cache: Any = getattr(kernel, "_cache", None)
    if not hasattr(cache, "_load_overload"):
        return
    look_and_prepare = cache.load_overload

    def load(signature: Any, context: Any) -> Any:
        with suppress(Exception):
            # What machine code calls by name: numba's memory, and Python's secret of hashes.
            importlib.import_module("numba.cpython.hashing")
            nrt = importlib.import_module("numba.core.runtime.nrt")
            nrt.rtsys.initialize(context)
            found = cache._load_overload(signature, context)
            if found is not None:
                return found
        return look_and_prepare(signature, context)

    cache.load_overload = load


def _save_alone(kernel: Any) -> None:
    """Let one process at a time write what it has compiled. Numba numbers the files of a kernel by
    what is there: two processes might give one number to machine code for different arguments.
    """
    cache: Any = getattr(kernel, "_cache", None)
    if not hasattr(cache, "save_overload"):
        return
    save = cache.save_overload

    def save_alone(signature: Any, compiled: Any) -> None:
        with _alone(Path(cache.cache_path)):
            save(signature, compiled)

    cache.save_overload = save_alone


@contextmanager
def _alone(folder: Path) -> Generator[None]:
    """Wait for whoever writes machine code to a folder; where none can be written, for nobody."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / ".machine_code").open("w")
    except OSError:
        yield
        return
    with lock:
        # A disk on a network may know no locks.
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def signals_held_back() -> Generator[None]:
    """Let SIGINT and SIGTERM raise what they raise afterwards. Only Python's own handlers wait: who
    listens for signals in another thread hears of them at once.
    """
    heard: list[tuple[int, FrameType | None]] = []
    before: dict[signal.Signals, Any] = {}
    both = (signal.SIGTERM, signal.SIGINT)
    if threading.current_thread() is threading.main_thread():
        before = {one: signal.getsignal(one) for one in both if callable(signal.getsignal(one))}
    try:
        for one in before:
            signal.signal(one, lambda *told: heard.append(told))
        yield
    finally:
        _restored(list(before.items()))
        for number, frame in heard:
            before[signal.Signals(number)](number, frame)


def _restored(handlers: list[tuple[signal.Signals, Any]]) -> None:
    """Put all handlers back, also where one of them raises as soon as it is back."""
    if handlers:
        try:
            signal.signal(*handlers[0])
        finally:
            _restored(handlers[1:])


def is_compiled() -> bool:
    """Whether all that a mission needs of machine code is on disk, made of the source that there is
    now, so that nothing is compiled while a boat waits.
    """
    try:
        return _STAMP.read_text() == _sources()
    except OSError:
        return False


def forget_compiled() -> None:
    """Remove the machine code of another source. A kernel holds those that it calls, and numba
    looks at its own file alone: one that calls a changed kernel would be run as it was. What was
    compiled before anything was noted is of the source that there is.
    """
    if not _STAMP.exists():
        return
    for folder in _PACKAGE.rglob("__pycache__"):
        for old in (*folder.glob("*.nbi"), *folder.glob("*.nbc")):
            with suppress(OSError):
                old.unlink()


def note_compiled() -> None:
    """Note that all of it is compiled; where the package cannot be written, nothing is noted."""
    with suppress(OSError):
        _STAMP.parent.mkdir(exist_ok=True)
        _STAMP.write_text(_sources())


def _sources() -> str:
    """What tells one source from another, its files' sizes and times; and which numba reads it.

    Not which is the newer: the clock of a boat's computer may stand still while it is off.
    """
    files = sorted(one for part in _OF_MISSIONS for one in (_PACKAGE / part).rglob("*.py"))
    told = [(one.name, one.stat().st_size, one.stat().st_mtime_ns) for one in files]
    return hashlib.sha256(repr((numba.__version__, told)).encode()).hexdigest()
