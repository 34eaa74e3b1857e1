"""How a process begins that works for another: it lives no longer than that one.

A pool's workers wait for work at a pipe whose other end they hold themselves: they would wait for
ever where the process that made them is killed.
"""

from __future__ import annotations

import os
import signal
import threading
import time

# How soon a worker sees that it works for nobody any more [s].
LOOK_S = 1.0


def begin_worker(parent: int) -> None:
    """End with the process `parent`, leave Ctrl-C to it, and use one thread of linear algebra."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
