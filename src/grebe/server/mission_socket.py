"""The socket through which clients on this computer watch a mission and give it orders.

While a survey is sailed, the file `SURVEY.gpkg.live` beside it holds the port on 127.0.0.1 and the
key that a client must send first. Each line to a client is a JSON object of changes, at most ten a
second; each line from a client is a command. A client that does not read is dropped, so none can
delay the boat.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import struct
import threading
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grebe.server.mission_delta import MissionDelta

if TYPE_CHECKING:
    from grebe.core.events import MissionEvent
    from grebe.io.store import SurveyFile
    from grebe.links.base import BoatLink
    from grebe.mission.departure import Departure
    from grebe.mission.loop import Mission

# Time between two messages [s].
PERIOD_S = 0.1
# A client that has not accepted a message for this long is dropped [s].
TIMEOUT_S = 2.0
TIMEOUT = struct.pack("ll", int(TIMEOUT_S), 0)
BY_THE_APP = "by the operator in the app"


def live_path(survey: Path) -> Path:
    """The file in which a mission under way says how to connect to it."""
    return survey.with_name(survey.name + ".live")


class MissionSocket:
    """The clients of a mission, or of the missions of a fleet's boats, by the boats' numbers. Every
    client hears of all missions, and its orders go to all. A fleet's messages name their boat.
    """

    def __init__(self, deltas: Mapping[int, MissionDelta], *, of_fleet: bool) -> None:
        self.deltas, self._of_fleet = dict(deltas), of_fleet
        self._boat = 1
        self._missions: dict[int, Mission] = {}
        self._clients: list[socket.socket] = []
        self._lock = threading.Lock()
        self._key = secrets.token_urlsafe(24)
        self._server_socket = socket.create_server(("127.0.0.1", 0))

    def open(self, beside: Path) -> None:
        """Write the .live file beside the survey, and accept clients."""
        text = json.dumps(
            {"port": self._server_socket.getsockname()[1], "key": self._key, "pid": os.getpid()}
        )
        path = live_path(beside)
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(text)
        for work in (self._accept_clients, self._send_changes):
            threading.Thread(target=work, daemon=True).start()

    def with_status(
        self, boat_at: Callable[[Departure], BoatLink]
    ) -> Callable[[Departure], BoatLink]:
        """The same link, whose status is also sent to the clients."""

        def opened(departure: Departure) -> BoatLink:
            self._boat = 1 if departure.sortie is None else departure.sortie.boat
            self.deltas[self._boat].link = link = boat_at(departure)
            return link

        return opened

    def on_event(self, event: MissionEvent, boat: int | None = None) -> None:
        """Take in an event of a boat's mission; without a number, of the boat opened last."""
        self.deltas[boat or self._boat].on_event(event)

    def attach(self, mission: Mission, boat: int | None = None) -> None:
        """Direct the orders for a boat to this mission from now on."""
        self._missions[boat or self._boat] = mission

    def close(self, beside: Path) -> None:
        """Send the last changes, and disconnect the clients."""
        self._send_once()
        live_path(beside).unlink(missing_ok=True)
        with self._lock:
            for client in self._clients:
                client.close()
        self._server_socket.close()

    def _accept_clients(self) -> None:
        while True:
            try:
                client, _ = self._server_socket.accept()
            except OSError:
                return
            threading.Thread(target=self._serve_client, args=(client,), daemon=True).start()

    def _serve_client(self, client: socket.socket) -> None:
        """Accept a client that knows the key, and follow its orders."""
        try:
            client.settimeout(TIMEOUT_S)
            lines = client.makefile("r", encoding="utf-8")
            if not secrets.compare_digest(lines.readline(200).strip(), self._key):
                client.close()
                return
            client.settimeout(None)
            # A time-out of the whole socket would also end the reading of orders, which may wait.
            client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, TIMEOUT)
            with self._lock:
                self._clients.append(client)
            while line := lines.readline(200):
                self._execute(line.strip())
        except (OSError, UnicodeDecodeError):
            pass

    def _execute(self, order: str) -> None:
        for mission in tuple(self._missions.values()):
            actions = {
                "pause": mission.hold_station,
                "continue": mission.go_on,
                "return": mission.come_home,
                "stop": mission.stop,
            }
            if order in actions:
                actions[order](BY_THE_APP)

    def _send_changes(self) -> None:
        while True:
            time.sleep(PERIOD_S)
            self._send_once()

    def _send_once(self) -> None:
        for boat, delta in self.deltas.items():
            changes = delta.take()
            if changes is not None:
                self._send({**changes, "boat": boat} if self._of_fleet else changes)

    def _send(self, changes: dict[str, Any]) -> None:
        line = json.dumps(changes, allow_nan=False).encode() + b"\n"
        with self._lock:
            for client in tuple(self._clients):
                try:
                    client.sendall(line)
                except OSError:
                    self._clients.remove(client)
                    client.close()


@contextmanager
def serve_clients(survey_file: SurveyFile) -> Generator[MissionSocket]:
    """Let clients watch the mission of a file, or those of its fleet, until the context ends."""
    survey, quantities = survey_file.survey, list(survey_file.quantities)
    boats = 1 if survey.fleet is None else survey.fleet.boats
    deltas = {boat: MissionDelta(survey, quantities) for boat in range(1, boats + 1)}
    mission_socket = MissionSocket(deltas, of_fleet=boats > 1)
    mission_socket.open(survey_file.path)
    try:
        yield mission_socket
    finally:
        mission_socket.close(survey_file.path)
