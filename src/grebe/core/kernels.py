"""Compilation of the numerical kernels by numba, and their cache on disk."""

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

# Sums may be reordered and multiplications fused. NaN and infinity keep their meaning, because
# the solver tests for them.
_FASTMATH = {"contract", "reassoc", "arcp", "nsz"}

_PACKAGE = Path(__file__).parents[1]
# The packages with a mission's kernels, and the file that records that all of them are compiled.
_OF_MISSIONS = ("core", "control", "mission", "links")
_STAMP = _PACKAGE / "core" / "__pycache__" / "missions_are_compiled"


def machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Compile a kernel at its first call; later processes load it from disk.

    It releases the GIL, so that other threads run meanwhile, such as the one that ends a command
    on request.
    """
    return _compiled(function, fastmath=_FASTMATH, nogil=True)


def exact_machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `machine_code`, but with every sum in the order written.

    For kernels whose rounding is part of the method.
    """
    return _compiled(function, nogil=True)


def part_of_kernels(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `machine_code`, for functions that only other kernels call.

    The code that would unpack Python's arguments is not compiled. A call from Python raises
    `TypeError`.
    """
    return _hidden(_compiled(function, fastmath=_FASTMATH, no_cpython_wrapper=True))


def inlined_machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `part_of_kernels`, but inlined into each kernel that calls it.

    For small kernels, which take less time than passing them a record of arrays.
    """
    options = {"no_cpython_wrapper": True, "forceinline": True}
    return _hidden(_compiled(function, fastmath=_FASTMATH, **options))


def _compiled(function: Callable[_Arguments, _Result], **options: Any) -> Any:
    # Kernels are never called from C.
    options = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True} | options
    return _compiled_in_peace(numba.njit(**options)(function))


def _hidden(kernel: Any) -> Any:
    """Keep Python from calling a kernel without an entry point, which would crash."""
    if not hasattr(kernel, "compile"):
        return kernel  # With NUMBA_DISABLE_JIT=1 it is the plain Python function.

    def refuse(*_: Any, **__: Any) -> None:
        raise TypeError(f"{kernel.__name__} can only be called from other kernels, not from Python")

    # Numba registers entry points with the first and looks for a missing one with the second.
    kernel._insert = lambda *_: None
    kernel._compile_for_args = refuse
    return kernel


def _compiled_in_peace(kernel: Any) -> Any:
    """Hold back signals while a kernel is compiled or loaded from disk.

    An exception that a signal raises within a callback from the compiler is lost there, and the
    machine code with it; the process then crashes.
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
    """Load a kernel's machine code without initialising the compiler.

    Numba first registers all that its compiler can translate, which takes a tenth of a second or
    more. If the kernel is not on disk, or another version of numba differs internally, numba's own
    loader is used.
    """
    cache: Any = getattr(kernel, "_cache", None)
    if not hasattr(cache, "_load_overload"):
        return
    look_and_prepare = cache.load_overload

    def load(signature: Any, context: Any) -> Any:
        with suppress(Exception):
            # Machine code refers to these by name: numba's memory, and Python's hash secret.
            importlib.import_module("numba.cpython.hashing")
            nrt = importlib.import_module("numba.core.runtime.nrt")
            nrt.rtsys.initialize(context)
            found = cache._load_overload(signature, context)
            if found is not None:
                return found
        return look_and_prepare(signature, context)

    cache.load_overload = load


def _save_alone(kernel: Any) -> None:
    """Let only one process at a time write compiled code.

    Numba numbers a kernel's files by the files that exist, so two processes could give one number
    to machine code for different arguments.
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
    """Hold a folder's lock for writing machine code; no lock if the folder is not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / ".machine_code").open("w")
    except OSError:
        yield
        return
    with lock:
        # A network disk may not support locks.
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def signals_held_back() -> Generator[None]:
    """Postpone the handlers of SIGINT and SIGTERM until afterwards.

    Only Python's handlers wait: a thread that listens for signals receives them at once.
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
    """Restore all handlers, even if one of them raises as soon as it is restored."""
    if handlers:
        try:
            signal.signal(*handlers[0])
        finally:
            _restored(handlers[1:])


def is_compiled() -> bool:
    """Return whether all machine code of a mission is on disk, compiled from the present source.

    Nothing is then compiled while a boat waits.
    """
    try:
        return _STAMP.read_text() == _sources()
    except OSError:
        return False


def forget_compiled() -> None:
    """Remove machine code that was compiled from another source.

    A kernel contains the kernels that it calls, but numba checks only the kernel's own file; a
    caller of a changed kernel would run the old code. Without a note, whatever is compiled comes
    from the present source and stays.
    """
    if not _STAMP.exists():
        return
    for folder in _PACKAGE.rglob("__pycache__"):
        for old in (*folder.glob("*.nbi"), *folder.glob("*.nbc")):
            with suppress(OSError):
                old.unlink()


def note_compiled() -> None:
    """Record that everything is compiled, unless the package's folder is not writable."""
    with suppress(OSError):
        _STAMP.parent.mkdir(exist_ok=True)
        _STAMP.write_text(_sources())


def _sources() -> str:
    """Hash of the sources' names, sizes and times and of numba's version.

    It does not compare which is newer: a boat's computer may lose its clock while it is off.
    """
    files = sorted(one for part in _OF_MISSIONS for one in (_PACKAGE / part).rglob("*.py"))
    told = [(one.name, one.stat().st_size, one.stat().st_mtime_ns) for one in files]
    return hashlib.sha256(repr((numba.__version__, told)).encode()).hexdigest()
