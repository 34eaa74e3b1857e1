"""Eight hours of watching: `python -m benchmarks.watching [--hours H]`; Linux.

A server watches one survey. A stand-in speaks as a mission does, for so many hours at ten messages
a second, as fast as the server takes them. Five pages read all of it, one never reads. Printed
each hour: the resident memory, and the CPU time per message.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import secrets
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from grebe.core.quantities import LIMNOLOGICAL
from grebe.server import plans
from grebe.server.library import identity
from grebe.server.live import MissionWatch
from grebe.server.mission_socket import live_path
from grebe.server.tabs import Lease, Tab

BEGAN, EACH_S, PAGES = 1.8e9, 0.1, 5


def told(count):
    """What a mission sends as its `count`-th message: an estimate each time, the rest at its own
    rate.
    """
    at = BEGAN + EACH_S * count
    lon, lat = 6.55 + 1e-6 * (count % 1000), 46.45 + 1e-6 * (count // 1000 % 1000)
    message = {
        "time": at, "heard": at, "thrusts": [3.0, 3.1],
        "estimate": {"lon": lon, "lat": lat, "heading_rad": 0.1, "surge_mps": 1.4,
                     "sway_mps": 0.0, "yaw_rate_radps": 0.0},
        "current": {"north_mps": 0.1, "east_mps": 0.0},
        "status": {"state": "running", "doing": "surveying", "reached": 1, "targets": 300},
    }  # fmt: skip
    if count % 5 == 0:
        message["horizon"] = [[lon + 1e-6 * k, lat] for k in range(25)]
    if count % 10 == 0:
        message["track"] = [[at, lon, lat, 1.4]]
        message["samples"] = [[at, lon, lat, [8.1] * len(LIMNOLOGICAL)]]
    if count % 600 == 0:
        message["events"] = [{"at": at, "time": "", "level": "info", "code": "x", "message": "y"}]
    return json.dumps(message).encode() + b"\n"


def memory_mb():
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


async def read(watch, name, heard):
    """A page that reads all."""
    async for part in watch.stream(Tab(name=name)):
        heard[name] += part.count(b"event: delta")


async def look_on(path, hours):
    """The watch, its pages, and the stand-in for a mission."""
    key, heard = secrets.token_urlsafe(8), {f"p{k}": 0 for k in range(PAGES)}
    each_hour = round(3600 / EACH_S)

    async def mission(reader, writer):
        await reader.readline()
        for hour in range(1, hours + 1):
            began = time.process_time()
            for count in range((hour - 1) * each_hour, hour * each_hour):
                writer.write(told(count))
                await writer.drain()
                # The pages get their turn, as they would between two messages: one that fell
                # behind would be sent everything anew.
                await asyncio.sleep(0)
            spent_ms = 1e3 * (time.process_time() - began) / each_hour
            print(f"hour {hour}: {memory_mb():.0f} MB, {spent_ms:.2f} ms a message", flush=True)
        writer.close()

    door = await asyncio.start_server(mission, "127.0.0.1", 0)
    port = door.sockets[0].getsockname()[1]
    live_path(path).write_text(json.dumps({"port": port, "key": key, "pid": os.getpid()}))
    watch = MissionWatch(identity(path), path, Lease())
    pages = [asyncio.create_task(read(watch, name, heard)) for name in heard]
    deaf = watch.stream(Tab(name="deaf"))
    await anext(deaf)
    while watch.under_way:
        await asyncio.sleep(0.5)
    for page in pages:
        page.cancel()
        with suppress(asyncio.CancelledError):
            await page
    print(
        f"messages read by the pages: {sorted(heard.values())}; a slow one gets snapshots between"
    )
    door.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=int, default=8)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "demo.gpkg"
        plans.keep_demo(str(path))
        asyncio.run(look_on(path, parser.parse_args().hours))


if __name__ == "__main__":
    main()
