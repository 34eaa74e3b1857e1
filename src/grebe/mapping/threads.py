"""One thread for linear algebra.

A map's matrices are small. On an idle machine, more threads than one gain nothing; on a busy one,
they wait for each other many times longer than they compute.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Generator[None, None, None]:
    """Limit BLAS to one thread within the context, and restore the previous limit after it."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
