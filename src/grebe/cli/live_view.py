"""grebe run --live: the app, in a process of its own, shows the mission of this terminal."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from grebe.cli import output
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile

if TYPE_CHECKING:
    from grebe.server.mission_socket import MissionSocket

# The app outlives the mission, and ends once no page has been open for this long.
IDLE_MINUTES = 10.0


@contextmanager
def live_view(survey_file: SurveyFile, *, wanted: bool) -> Generator[MissionSocket | None]:
    """Show a mission, or those of a fleet, in the app if `wanted`, and print the app's address.

    The mission does not depend on the app: it sails whether or not the app starts, and continues
    when the app ends. Raises `UsageError` if the app is not installed.
    """
    if not wanted:
        yield None
        return
    if missing := [name for name in ("starlette", "uvicorn") if find_spec(name) is None]:
        raise UsageError(
            f"The app needs {' and '.join(missing)}: pip install 'grebe[app]'.", settings=("live",)
        )
    from grebe.server.mission_socket import serve_clients

    with serve_clients(survey_file) as mission_socket:
        threading.Thread(target=_open_app, args=(survey_file.path,), daemon=True).start()
        yield mission_socket


def _open_app(survey: Path) -> None:
    """Start the app and print its address when it answers."""
    command = [
        sys.executable, "-c", "from grebe.cli.main import main; main()", "app",
        "--dir", survey.resolve().parent,
        "--show", survey, "--port", "0", "--no-browser", "--idle-minutes", str(IDLE_MINUTES),
    ]  # fmt: skip
    try:
        app = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
        )
    except OSError as error:
        output.note(f"the app does not start ({error}); the mission goes on")
        return
    assert app.stdout is not None
    address = app.stdout.readline().strip()
    said = f"watch it at {address}" if address else "the app did not start; the mission goes on"
    output.note(said)
