"""Engines give the same results, and lose nothing with a worker."""

import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from grebe.campaigns.engine import TRIES, Dask, Processes, Serial, engine_of
from grebe.core.errors import LinkError, UsageError


def squared(number):
    return number * number


class DiesOnce:
    """Kills the first worker that gets each deadly item; a file records that it has happened."""

    def __init__(self, folder: Path, deadly: set[int]) -> None:
        self.folder, self.deadly = folder, deadly

    def __call__(self, number: int) -> int:
        mark = self.folder / str(number)
        if number in self.deadly and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return squared(number)


def always_dies(number):
    os.kill(os.getpid(), signal.SIGKILL)


def test_processes_give_what_one_process_gives():
    assert dict(Processes(workers=2).results(squared, range(30))) == dict(
        Serial().results(squared, range(30))
    )


def test_a_worker_that_is_killed_loses_nothing(tmp_path):
    task = DiesOnce(tmp_path, {0, 7, 19})
    results = list(Processes(workers=2).results(task, range(20)))
    assert sorted(results) == [(i, i * i) for i in range(20)]  # each once
    assert len(list(tmp_path.iterdir())) == 3


def test_a_task_that_kills_every_worker_is_given_up():
    with pytest.raises(LinkError, match=f"{TRIES} worker processes died"):
        list(Processes(workers=1).results(always_dies, range(1)))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # what Dask's own threads and sockets say when it ends
def test_dask_gives_the_same_and_loses_nothing_with_a_worker(tmp_path):
    pytest.importorskip("distributed")
    task = DiesOnce(tmp_path, {5})
    assert sorted(Dask(workers=2).results(task, range(12))) == [(i, i * i) for i in range(12)]
    assert (tmp_path / "5").exists()
    assert not multiprocessing.active_children()


def test_a_missing_scheduler_is_reported():
    pytest.importorskip("distributed")
    with pytest.raises(LinkError, match="No Dask scheduler answers at nowhere"):
        list(Dask(scheduler="nowhere").results(squared, range(3)))


def test_engines_by_what_is_asked_for():
    assert engine_of(1, None) == Serial()
    assert engine_of(3, None) == Processes(workers=3)
    assert engine_of(2, "tcp://there:8786") == Dask(scheduler="tcp://there:8786", workers=2)
    with pytest.raises(UsageError):
        Processes(workers=0)
