"""A mission in a process of its own, so that no failure of a page or the server affects the boat.

python -m grebe.server.boat SURVEY.gpkg '{"link": "sim:", "rate": 10}'
"""

from __future__ import annotations

import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

from grebe.core.dynamics import Weather
from grebe.core.errors import GrebeError
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Observation
from grebe.links.forwarding import ForwardingLink
from grebe.mission.departure import Departure
from grebe.server.mission_request import Voyage
from grebe.server.mission_socket import serve_clients
from grebe.workflow.boats import Harbour, boat_named
from grebe.workflow.kernel_cache import compile_controller
from grebe.workflow.quality import check_samples
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld
from grebe.workflow.steering_names import rule_named


class Paced(ForwardingLink):
    """A simulated boat that runs `rate` times as fast as the clock."""

    def __init__(self, link: BoatLink, rate: float) -> None:
        super().__init__(link)
        self._rate = rate
        self._due: float | None = None
        self._before_s = 0.0

    def observe(self) -> Observation:
        """Return the next estimate once it is due by the clock."""
        seen = self._link.observe()
        now = time.monotonic()
        passed_s = (seen.time_s - self._before_s) / self._rate
        self._before_s = seen.time_s
        # Time lost to slow steps is made up for, up to one second of it.
        self._due = now if self._due is None else max(self._due + passed_s, now - 1.0)
        if self._due > now:
            time.sleep(self._due - now)
        return seen


def sail(path: Path, voyage: Voyage) -> None:
    """Sail a survey and record its measurements; raises the errors of `run_survey`."""
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

        def boat_at(departure: Departure) -> BoatLink:
            link = open_boat(departure)
            return Paced(link, voyage.rate) if voyage.link == "sim:" else link

        with serve_clients(survey_file) as mission_socket:
            run_survey(
                survey_file,
                mission_socket.with_status(boat_at),
                steered_by(rule_named(voyage.rule)),
                datetime.now(UTC),
                resume=voyage.resume,
                force=voyage.force,
                listeners=[mission_socket.on_event],
                on_ready=mission_socket.attach,
            )
            check_samples(survey_file)


def main(arguments: list[str]) -> int:
    """Sail the voyage that the command-line arguments describe, and return the exit code."""
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
