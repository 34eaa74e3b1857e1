"""grebe app: plan, watch, steer and read a survey in a browser."""

from __future__ import annotations

import socket
import sys
import threading
import webbrowser
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, UsageError

HOST = "127.0.0.1"
DEFAULT_PORT = 8737


@click.command(name="app")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_PORT,
    show_default=True,
    help="Where to listen on this computer; 0 takes a free one.",
)
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@click.option("--demo", is_flag=True, help="Put the demo's survey into the folder first.")
@click.option(
    "--dir",
    "folder",
    type=options.FOLDER,
    default=Path(),
    help="Folder of the surveys.  [default: this one]",
)
@click.option("--print-token", is_flag=True, help="Print the token with which scripts ask.")
def command(port: int, no_browser: bool, demo: bool, folder: Path, print_token: bool) -> None:
    """Open the app: plan, watch, steer and read surveys in a browser, on this computer alone.

    A survey that is under way goes on where the app is ended, and is found again.
    """
    try:
        import uvicorn

        from grebe.server.app import make_app
        from grebe.server.security import Keys
    except ModuleNotFoundError as error:
        raise UsageError(f"The app needs {error.name}: pip install 'grebe[app]'.") from None
    from grebe.workflow.files import make_folder
    from grebe.workflow.warm import compile_controller

    make_folder(folder)
    folder = folder.resolve()
    door = _door(port)
    port = door.getsockname()[1]
    keys = Keys(folder, port)
    if demo:
        _keep_demo(folder)
    address = f"http://{HOST}:{port}/?token={keys.launch_token}"
    output.note(f"Surveys in {folder}; Ctrl-C ends the app, and no mission with it. Open:")
    click.echo(address)
    if print_token:
        click.echo(keys.bearer)
    sys.stdout.flush()
    threading.Thread(target=compile_controller, daemon=True).start()
    if not no_browser:
        threading.Timer(0.5, webbrowser.open, (address,)).start()
    hosts = frozenset({f"{HOST}:{port}", f"localhost:{port}"})
    settings = uvicorn.Config(
        make_app(folder, keys, hosts),
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=1,
        server_header=False,
    )
    uvicorn.Server(settings).run(sockets=[door])


def _door(port: int) -> socket.socket:
    """The socket on which the app listens."""
    door = socket.socket()
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        door.bind((HOST, port))
        # Whoever reads the address may ask at once, and waits until there is an answer.
        door.listen()
    except OSError as error:
        door.close()
        raise InputError(
            f"Port {port} cannot be had ({error.strerror}); is the app open already?",
            settings=("port",),
        ) from None
    return door


def _keep_demo(folder: Path) -> None:
    from grebe.workflow.demo import NOTE, demo_survey
    from grebe.workflow.files import write_survey

    path = folder / "demo.gpkg"
    if not path.exists():
        write_survey(path, demo_survey(), note=NOTE)
