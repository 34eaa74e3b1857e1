"""Begin a process that works for another, and lives no longer than it.

The workers of a pool wait for work at a pipe whose other end they hold themselves. They would wait
forever if the process that made them were killed.
"""

from __future__ import annotations

import os
import signal
import threading
import time

# How often a worker checks that the process it works for still exists [s].
LOOK_S = 1.0


def begin_worker(parent: int) -> None:
    """End with the process `parent`, leave Ctrl-C to it, and use one thread for linear algebra."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
