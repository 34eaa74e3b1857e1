"""One process beside the server for long work; it is replaced if it dies.

Only that process imports the module that does the work, so the server starts without waiting for
the import.
"""

from __future__ import annotations

import asyncio
import functools
import importlib
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from grebe.core.errors import InputError
from grebe.workflow.worker_processes import begin_worker


class Worker:
    """Calls the functions of `module` one after another, in a process of its own."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._pool = self._new()

    @staticmethod
    def _new() -> ProcessPoolExecutor:
        # Forking a process that runs threads is not safe.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, context, begin_worker, (os.getpid(),))

    async def run(self, name: str, *given: Any, **named: Any) -> Any:
        """Call the function of that name and return its result.

        Raises `InputError` if the process died of it, for example of a lack of memory; the next
        call gets a new process.
        """
        pool = self._pool
        work = functools.partial(_done, self._module, name, *given, **named)
        try:
            return await asyncio.get_running_loop().run_in_executor(pool, work)
        except BrokenProcessPool:
            if self._pool is pool:
                self._pool = self._new()
            raise InputError(
                "This was too much for this computer (the process died); ask for less."
            ) from None

    def begin(self, name: str) -> None:
        """Start a call whose result nobody waits for."""
        self._pool.submit(_done, self._module, name)

    def close(self) -> None:
        """End the process without waiting, and cancel pending calls."""
        self._pool.shutdown(wait=False, cancel_futures=True)


def _done(module: str, name: str, *given: Any, **named: Any) -> Any:
    return getattr(importlib.import_module(module), name)(*given, **named)
