"""One thread for linear algebra.

The matrices of a map are small: more threads than one gain nothing on an idle machine, and on a
busy one they wait for each other many times as long as they compute.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Generator[None, None, None]:
    """Within it BLAS uses one thread; what held before is restored."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
