"""A mission in a process of its own, which says what happens to whoever connects on this computer.

    python -m grebe.server.boat SURVEY.gpkg '{"link": "sim:", "rate": 10}'

Beside the survey lies `SURVEY.gpkg.live` while it sails: the port on 127.0.0.1 and the key with
which a client begins. Each line to the client is a JSON object of what changed, at most ten a
second; each line from it is a command. A client that does not read is dropped: none can hold the
boat up.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from grebe.core.dynamics import Weather
from grebe.core.errors import GrebeError
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Observation, Order
from grebe.mission.departure import Departure
from grebe.mission.loop import Mission
from grebe.server.telling import Telling
from grebe.workflow.boats import Harbour, boat_named
from grebe.workflow.quality import check_samples
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld
from grebe.workflow.steering import rule_named
from grebe.workflow.warm import compile_controller

# What happens is told this often [s].
EACH_S = 0.1
# A client that does not take what it is told for so long is dropped [s].
PATIENCE_S = 2.0
BY_THE_APP = "by the operator in the app"


@dataclass(frozen=True, kw_only=True)
class Voyage:
    """How a survey is to be sailed: over which `link`, by which `rule`; simulated water with
    `weather`, `rate` times as fast as the clock; `resume` goes on, `force` begins anew.
    """

    link: str = "sim:"
    rule: str = "lookahead"
    rate: float = 1.0
    weather: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    resume: bool = False
    force: bool = False


def live_path(survey: Path) -> Path:
    """Where a mission under way says how it is reached."""
    return survey.with_name(survey.name + ".live")


class Paced:
    """A simulated boat that waits for the clock, `rate` of its seconds to each of ours."""

    def __init__(self, link: BoatLink, rate: float) -> None:
        self._link = link
        self._rate = rate
        self._due: float | None = None
        self._before_s = 0.0

    @property
    def source(self) -> str:
        """See `BoatLink`."""
        return self._link.source

    def observe(self) -> Observation:
        """Return the next estimate, when it is due by the clock."""
        seen = self._link.observe()
        now = time.monotonic()
        passed_s = (seen.time_s - self._before_s) / self._rate
        self._before_s = seen.time_s
        # What was lost to a slow step is made good, but not more than a second of it.
        self._due = now if self._due is None else max(self._due + passed_s, now - 1.0)
        if self._due > now:
            time.sleep(self._due - now)
        return seen

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        self._link.command(order)

    def measure(self) -> Mapping[str, float]:
        """See `BoatLink`."""
        return self._link.measure()

    def status(self) -> Any:
        """See `BoatLink`."""
        return self._link.status()

    def stop(self) -> None:
        """See `BoatLink`."""
        self._link.stop()

    def close(self) -> None:
        """See `BoatLink`."""
        self._link.close()


class Ears:
    """The clients of a mission: all of them are told, and what they order goes to the mission."""

    def __init__(self, telling: Telling) -> None:
        self._telling = telling
        self._mission: Mission | None = None
        self._clients: list[socket.socket] = []
        self._lock = threading.Lock()
        self._key = secrets.token_urlsafe(24)
        self._door = socket.create_server(("127.0.0.1", 0))

    def open(self, beside: Path) -> None:
        """Say how the mission is reached, and let clients in."""
        text = json.dumps(
            {"port": self._door.getsockname()[1], "key": self._key, "pid": os.getpid()}
        )
        path = live_path(beside)
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(text)
        for work in (self._let_in, self._tell):
            threading.Thread(target=work, daemon=True).start()

    def obeys(self, mission: Mission) -> None:
        """Orders go to this mission from here on."""
        self._mission = mission

    def close(self, beside: Path) -> None:
        """Tell what is left, and go."""
        self._tell_once()
        live_path(beside).unlink(missing_ok=True)
        with self._lock:
            for client in self._clients:
                client.close()
        self._door.close()

    def _let_in(self) -> None:
        while True:
            try:
                client, _ = self._door.accept()
            except OSError:
                return
            threading.Thread(target=self._hear, args=(client,), daemon=True).start()

    def _hear(self, client: socket.socket) -> None:
        """Take a client in that knows the key, and do what it orders."""
        try:
            client.settimeout(PATIENCE_S)
            lines = client.makefile("r", encoding="utf-8")
            if not secrets.compare_digest(lines.readline(200).strip(), self._key):
                client.close()
                return
            client.settimeout(None)
            with self._lock:
                self._clients.append(client)
            while line := lines.readline(200):
                self._obey(line.strip())
        except (OSError, UnicodeDecodeError):
            pass

    def _obey(self, order: str) -> None:
        mission = self._mission
        if mission is None:
            return
        deeds = {
            "pause": mission.hold_station,
            "continue": mission.go_on,
            "return": mission.come_home,
            "stop": mission.stop,
        }
        if order in deeds:
            deeds[order](BY_THE_APP)

    def _tell(self) -> None:
        while True:
            time.sleep(EACH_S)
            self._tell_once()

    def _tell_once(self) -> None:
        told = self._telling.take()
        if told is None:
            return
        line = json.dumps(told, allow_nan=False).encode() + b"\n"
        with self._lock:
            for client in tuple(self._clients):
                try:
                    client.settimeout(PATIENCE_S)
                    client.sendall(line)
                    client.settimeout(None)
                except OSError:
                    self._clients.remove(client)
                    client.close()


def sail(path: Path, voyage: Voyage) -> None:
    """Sail a survey and keep what is measured; raises what `run_survey` raises."""
    compile_controller()
    north, east, force_north, force_east = voyage.weather
    weather = Weather(
        current_north_mps=north,
        current_east_mps=east,
        wind_force_north_n=force_north,
        wind_force_east_n=force_east,
    )
    world = SimulatedWorld(weather=weather)
    open_boat = boat_named(voyage.link, Harbour(world=world, confirm=lambda _: True))
    with SurveyFile.open(path) as survey_file:
        telling = Telling(survey_file.survey, list(survey_file.quantities))
        ears = Ears(telling)

        def boat_at(departure: Departure) -> BoatLink:
            link = open_boat(departure)
            telling.link = link
            return Paced(link, voyage.rate) if voyage.link == "sim:" else link

        ears.open(path)
        try:
            run_survey(
                survey_file,
                boat_at,
                steered_by(rule_named(voyage.rule)),
                datetime.now(UTC),
                resume=voyage.resume,
                force=voyage.force,
                listeners=[telling.hear],
                on_ready=ears.obeys,
            )
            check_samples(survey_file)
        finally:
            ears.close(path)


def main(arguments: list[str]) -> int:
    """Sail as the arguments say; return the exit code."""
    path, given = Path(arguments[0]), json.loads(arguments[1])
    given["weather"] = tuple(given.get("weather", (0.0, 0.0, 0.0, 0.0)))
    try:
        sail(path, Voyage(**given))
    except GrebeError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
