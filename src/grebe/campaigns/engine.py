"""Engines that run tasks: in this process, in processes of this computer, or on a Dask cluster.

An engine takes a pure function and its arguments, and yields results as they are ready, in any
order. Nothing is lost when a worker dies: its tasks are done again by another worker, with the same
results. A task with which `TRIES` workers have died is not tried again.
"""

from __future__ import annotations

import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from itertools import islice
from typing import Any, Protocol, TypeVar

from grebe.core.errors import LinkError, UsageError
from grebe.workflow.worker_processes import begin_worker

A = TypeVar("A")
R = TypeVar("R")

TRIES = 5
# Tasks per worker, running or waiting: no worker idles, and little work is wasted at a stop.
AHEAD = 2


class Engine(Protocol):
    """Runs tasks."""

    def results(self, task: Callable[[A], R], items: Iterable[A]) -> Generator[tuple[A, R]]:
        """Yield each item with its result, as results are ready; closing the generator stops it."""
        ...


@dataclass(frozen=True, kw_only=True)
class Serial:
    """Runs tasks one after the other, in this process."""

    def results(self, task: Callable[[A], R], items: Iterable[A]) -> Generator[tuple[A, R]]:
        """See `Engine`."""
        for item in items:
            yield item, task(item)


@dataclass(frozen=True, kw_only=True)
class Processes:
    """Runs tasks in `workers` processes of this computer (None: one per core)."""

    workers: int | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"{self.workers} worker processes are impossible; give at least one.")

    @property
    def count(self) -> int:
        """The number of processes."""
        return self.workers or os.cpu_count() or 1

    def results(self, task: Callable[[A], R], items: Iterable[A]) -> Generator[tuple[A, R]]:
        """See `Engine`."""
        left, again, tried = iter(items), list[A](), Counter[A]()
        while True:
            round_ = _Round(self.count, task, left, again)
            with closing(round_.results()) as results:
                for item, result in results:
                    tried.pop(item, None)
                    yield item, result
            again = round_.lost + again
            if not again:
                return
            tried.update(round_.lost)
            hopeless = [item for item in again if tried[item] >= TRIES]
            if hopeless:
                raise LinkError(
                    f"{TRIES} worker processes died one after the other while working on task "
                    f"{hopeless[0]}; is there enough memory for so many?",
                    settings=("workers",),
                )


class _Round:
    """The life of one pool: to the end of the items, or to the death of a worker."""

    def __init__(
        self, count: int, task: Callable[[Any], Any], left: Iterator[Any], again: list[Any]
    ) -> None:
        self._count = count
        self._task = task
        self._left = left
        self._again = again
        self._handed_out = 0
        self._under_way: dict[Future[Any], tuple[int, Any]] = {}
        self._lost: list[tuple[int, Any]] = []

    @property
    def lost(self) -> list[Any]:
        """The items under way when a worker died, the longest waiting first. They are started first
        again, so that no item is lost time after time because of others.
        """
        return [item for _, item in sorted(self._lost, key=lambda one: one[0])]

    def results(self) -> Generator[tuple[Any, Any]]:
        """Yield results until all is done or a worker dies; `lost` are the items under way then."""
        pool = ProcessPoolExecutor(
            self._count, multiprocessing.get_context("spawn"), begin_worker, (os.getpid(),)
        )
        try:
            self._fill(pool)
            while self._under_way:
                done, _ = wait(self._under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    number, item = self._under_way.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        self._lost.append((number, item))
                    else:
                        yield item, future.result()
                if not self._lost:
                    self._fill(pool)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)

    def _fill(self, pool: ProcessPoolExecutor) -> None:
        """Submit as many items as fit; if the pool is broken, the item goes to the lost ones."""
        room = AHEAD * self._count - len(self._under_way)
        for _ in range(room):
            item = self._again.pop(0) if self._again else next(self._left, _END)
            if item is _END:
                return
            self._handed_out += 1
            try:
                self._under_way[pool.submit(self._task, item)] = self._handed_out, item
            except BrokenProcessPool:
                self._lost.append((self._handed_out, item))
                return


_END: Any = object()


@dataclass(frozen=True, kw_only=True)
class Dask:
    """Runs tasks on a Dask cluster: that of a scheduler's address, or a local one of `workers`.

    Dask itself gives the tasks of a lost worker to another.
    """

    scheduler: str | None = None
    workers: int | None = None

    def results(self, task: Callable[[A], R], items: Iterable[A]) -> Generator[tuple[A, R]]:
        """See `Engine`."""
        distributed = _distributed()
        with self._cluster(distributed) as where, self._client(distributed, where) as client:
            shared = client.scatter(task, broadcast=True)
            width = max(1, sum(client.nthreads().values()))
            left = iter(items)

            def hand_out(count: int) -> list[Any]:
                return [
                    client.submit(_call, shared, item, pure=False, retries=TRIES)
                    for item in islice(left, count)
                ]

            under_way = distributed.as_completed(hand_out(AHEAD * width), with_results=True)
            for future, (item, result) in under_way:
                future.release()
                yield item, result
                for more in hand_out(1):
                    under_way.add(more)

    def _cluster(self, distributed: Any) -> AbstractContextManager[Any]:
        """The scheduler's address, or a local cluster that ends with the work."""
        if self.scheduler is not None:
            return nullcontext(self.scheduler)
        cluster: AbstractContextManager[Any] = distributed.LocalCluster(
            n_workers=self.workers or os.cpu_count() or 1,
            threads_per_worker=1,
            dashboard_address=None,
        )
        return cluster

    def _client(self, distributed: Any, where: Any) -> Any:
        try:
            return distributed.Client(where, timeout=10)
        except (OSError, ValueError, TypeError) as error:
            raise LinkError(
                f"No Dask scheduler answers at {self.scheduler}: {error}.", settings=("scheduler",)
            ) from None


def _call(task: Callable[[A], R], item: A) -> tuple[A, R]:
    return item, task(item)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise UsageError(
            "A Dask cluster needs Dask: pip install 'grebe[dask]', or use worker processes instead."
        ) from None
    return distributed


def engine_of(workers: int | None, scheduler: str | None, *, dask: bool = False) -> Engine:
    """Return the engine for the settings: a cluster, processes, or for one worker this process."""
    if scheduler is not None or dask:
        return Dask(scheduler=scheduler, workers=workers)
    return Serial() if workers == 1 else Processes(workers=workers)
