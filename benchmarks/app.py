"""The app's server under load: `python -m benchmarks.app [--seconds N] [--rate R]`; Linux.

`grebe app` is started as a user starts it, with a survey of some ten thousand cells and fifty
thousand points of track (`benchmarks.web`). First the benchmark prints how soon the address was
printed and a page was answered. Then a simulated mission sails at the clock's own rate, ten
messages a second, with no page, with five, with fifty, and with fifty of which ten never read. For
each it prints the server's share of a core and its resident memory, from /proc, without the
processes of the mission, of maps and of plans; and the messages per second that a reading page
received.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from benchmarks.web import POINTS, RUN, survey_file

TICKS = os.sysconf("SC_CLK_TCK")


def used(pid):
    """CPU time [s] and resident memory [MB] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    cpu = (int(fields[11]) + int(fields[12])) / TICKS
    return cpu, pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Server:
    """`grebe app` of a folder, and requests to it."""

    def __init__(self, folder):
        began = time.monotonic()
        self.process = subprocess.Popen(
            [sys.executable, "-c", RUN, "app", "--port", "0", "--no-browser", "--print-token",
             "--dir", folder],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        address = self.process.stdout.readline()
        self.printed_s = time.monotonic() - began
        self.token = self.process.stdout.readline().strip()
        self.port = int(address.partition("127.0.0.1:")[2].partition("/")[0])
        self.ask("GET", "/")
        self.answered_s = time.monotonic() - began

    def ask(self, method, path, body=None):
        """The JSON of an answer, or None for a page."""
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=300)
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        line.request(method, path, None if body is None else json.dumps(body), headers)
        answer = line.getresponse()
        data = answer.read()
        line.close()
        if answer.status >= 400:
            sys.exit(f"{method} {path}: {answer.status} {data.decode()}")
        is_json = answer.getheader("content-type", "").startswith("application/json")
        return json.loads(data) if is_json and data else None


class Page:
    """A stream of one survey: read and counted or, if `deaf`, left unread."""

    def __init__(self, server, survey, name, deaf):
        self.heard = 0
        self._line = socket.socket()
        if deaf:
            self._line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._line.connect(("127.0.0.1", server.port))
        self._line.sendall(
            f"GET /api/surveys/{survey}/events?tab={name} HTTP/1.1\r\n"
            f"Host: 127.0.0.1:{server.port}\r\n"
            f"Authorization: Bearer {server.token}\r\n\r\n".encode()
        )
        if not deaf:
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        try:
            while data := self._line.recv(2**18):
                self.heard += data.count(b"event: delta")
        except OSError:
            pass

    def close(self):
        """Close the stream, as when a tab is closed."""
        self._line.close()


def measure(server, survey, pages, deaf, seconds):
    """One row: share of a core, memory, messages a second of a page that reads."""
    tabs = [Page(server, survey, f"p{k}", k < deaf) for k in range(pages)]
    time.sleep(5)
    heard = [tab.heard for tab in tabs[deaf:]]
    began, (cpu, _) = time.monotonic(), used(server.process.pid)
    time.sleep(seconds)
    took, (after, memory) = time.monotonic() - began, used(server.process.pid)
    rates = [(tab.heard - before) / took for tab, before in zip(tabs[deaf:], heard, strict=True)]
    least = f"{min(rates):4.1f}" if rates else "   -"
    print(
        f"{pages:3d} pages, {deaf:2d} of them deaf: {100 * (after - cpu) / took:5.1f} % of a core, "
        f"{memory:4.0f} MB, {least} messages a second to the least",
        flush=True,
    )
    for tab in tabs:
        tab.close()
    time.sleep(2)


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("--seconds", type=float, default=20.0)
    asked.add_argument("--rate", type=float, default=1.0)
    given = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print("cells:", survey_file(Path(folder) / "large.gpkg"), "points:", POINTS)
        Server(folder).process.send_signal(signal.SIGINT)
        time.sleep(3)
        server = Server(folder)
        print(f"address printed after {server.printed_s:.2f} s, page after {server.answered_s:.2f}")
        survey = server.ask("GET", "/api/surveys")[0]["id"]
        voyage = {"link": "simulated", "rate": given.rate, "force": True}
        server.ask("POST", f"/api/surveys/{survey}/run", voyage)
        time.sleep(10)
        for pages, deaf in ((0, 0), (5, 0), (50, 0), (50, 10), (5, 0)):
            measure(server, survey, pages, deaf, given.seconds)
        server.ask("POST", f"/api/surveys/{survey}/stop", {})
        time.sleep(3)
        server.process.send_signal(signal.SIGINT)
        server.process.wait(10)


if __name__ == "__main__":
    main()
