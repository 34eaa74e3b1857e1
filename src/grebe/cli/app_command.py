"""grebe app: plan, watch, steer and read surveys in a browser."""

from __future__ import annotations

import os
import socket
import ssl
import sys
import threading
import time
import webbrowser
from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, UsageError

HOST = "127.0.0.1"
LOCAL = (HOST, "localhost", "::1")
DEFAULT_PORT = 8737
PASSWORD_VARIABLE = "GREBE_PASSWORD"


@click.command(name="app")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_PORT,
    show_default=True,
    help="Port to listen on; 0 takes a free one.",
)
@click.option("--no-browser", is_flag=True, help="Print the address only; open no browser.")
@click.option("--demo", is_flag=True, help="Put the demo survey into the folder first.")
@click.option(
    "--dir",
    "folder",
    type=options.FOLDER,
    default=Path(),
    help="Folder of the surveys.  [default: the current folder]",
)
@click.option(
    "--background",
    type=options.EXISTING,
    help="Your own map under the water: a .pmtiles or .mbtiles file of images.",
)
@click.option("--print-token", is_flag=True, help="Print the token that scripts need.")
@click.option("--show", "shown", type=options.EXISTING, help="Survey of the folder to show first.")
@click.option(
    "--idle-minutes",
    type=click.FloatRange(min=0.1),
    help="End the app when no page has been open for this many minutes.",
)
@click.option(
    "--host",
    default=HOST,
    show_default=True,
    help="Address to listen on; 0.0.0.0 lets other computers in, over TLS and with a password.",
)
@click.option(
    "--name",
    "names",
    multiple=True,
    help="Name by which other computers reach this one; may be repeated.",
)
@click.option(
    "--certificate", type=options.EXISTING, help="For other computers: certificate chain (PEM)."
)
@click.option("--key", type=options.EXISTING, help="For other computers: private key (PEM).")
@click.option(
    "--password-file",
    type=options.EXISTING,
    help=f"For other computers: file with the password.  [default: ${PASSWORD_VARIABLE}, or a "
    "prompt]",
)
def command(
    port: int,
    no_browser: bool,
    demo: bool,
    folder: Path,
    background: Path | None,
    print_token: bool,
    shown: Path | None,
    idle_minutes: float | None,
    **remote: Any,
) -> None:
    """Open the app: plan, watch, steer and read surveys in a browser.

    By default only this computer can reach it. A mission continues when the app ends, and the app
    finds it when it is started again.
    """
    try:
        from grebe.server.app import make_app
        from grebe.server.background import open_background
        from grebe.server.idle import Idle
        from grebe.server.library import identity
        from grebe.server.security import Keys
    except ModuleNotFoundError as error:
        raise UsageError(f"The app needs {error.name}: pip install 'grebe[app]'.") from None
    from grebe.workflow.files import make_folder

    under = None if background is None else open_background(background)
    tls, password = _remote(**remote)
    make_folder(folder)
    folder = folder.resolve()
    door = _door(remote["host"], port)
    port = door.getsockname()[1]
    keys = Keys(folder, port, password)
    if demo:
        _keep_demo(folder)
    names = [*LOCAL[:2], remote["host"], *remote["names"]]
    reached = remote["names"][0] if remote["names"] else HOST
    at = "" if shown is None else f"#/live/{identity(shown)}"
    address = f"http{'s' if tls else ''}://{reached}:{port}/?token={keys.launch_token}{at}"
    output.note(f"Surveys in {folder}; Ctrl-C ends the app, but not a mission. Open:")
    click.echo(address)
    if print_token:
        click.echo(keys.bearer)
    sys.stdout.flush()
    if not no_browser:
        threading.Timer(0.5, webbrowser.open, (address,)).start()
    hosts = frozenset(f"{name.lower()}:{port}" for name in names)
    app = Idle(make_app(folder, keys, hosts, under))
    _serve(app, door, tls, idle_minutes)


def _serve(app: Any, door: socket.socket, tls: dict[str, Any], idle_minutes: float | None) -> None:
    """Serve until Ctrl-C, or until no page has been open for `idle_minutes`."""
    import uvicorn

    from grebe.server.app import AFTER_PAINT_S

    settings = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=1,
        server_header=False,
        **tls,
    )
    server = uvicorn.Server(settings)

    def end_when_idle(most: float) -> None:
        while app.minutes() < most:
            time.sleep(0.5)
        server.should_exit = True

    later = threading.Timer(AFTER_PAINT_S, _make_ready)
    later.daemon = True
    later.start()
    if idle_minutes is not None:
        threading.Thread(target=end_when_idle, args=(idle_minutes,), daemon=True).start()
    server.run(sockets=[door])


def _make_ready() -> None:
    from grebe.workflow.kernel_cache import compile_controller

    compile_controller()


def _remote(
    host: str,
    names: tuple[str, ...],
    certificate: Path | None,
    key: Path | None,
    password_file: Path | None,
) -> tuple[dict[str, Any], str | None]:
    """Uvicorn's TLS settings and the password; empty and None if only this computer has access."""
    if certificate is None and key is None and password_file is None and host in LOCAL:
        if names:
            raise UsageError("A --name is only for other computers; see --host.")
        return {}, None
    if certificate is None or key is None:
        raise UsageError(
            "Other computers reach the app over TLS only; give --certificate and --key."
        )
    if not names:
        raise UsageError(
            "Give the name by which other computers reach this one.",
            settings=("name",),
        )
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise InputError(
            f"{certificate} and {key} are not a certificate and its key ({error}).",
            settings=("certificate",),
        ) from None
    tls = {"ssl_certfile": str(certificate), "ssl_keyfile": str(key)}
    return tls, _password(password_file)


def _password(file: Path | None) -> str:
    from grebe.server.login import LEAST_LENGTH

    if file is not None:
        try:
            password = file.read_text(encoding="utf-8").strip("\r\n")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"The password cannot be read from {file} ({error}).") from None
    else:
        password = os.environ.get(PASSWORD_VARIABLE) or click.prompt(
            "Password for other computers", hide_input=True, err=True
        )
    if len(password) < LEAST_LENGTH:
        raise UsageError(
            f"A password for other computers needs at least {LEAST_LENGTH} characters.",
            settings=("password_file",),
        )
    return password


def _door(host: str, port: int) -> socket.socket:
    """The socket on which the app listens."""
    door = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        door.bind((host, port))
        # A browser may connect as soon as the address is printed; it then waits for the answer.
        door.listen()
    except OSError as error:
        door.close()
        raise InputError(
            f"Cannot listen on port {port} of {host} ({error.strerror}); is the app open already?",
            settings=("port",),
        ) from None
    return door


def _keep_demo(folder: Path) -> None:
    from grebe.workflow.demo import NOTE, demo_survey
    from grebe.workflow.files import write_survey

    path = folder / "demo.gpkg"
    if not path.exists():
        write_survey(path, demo_survey(), note=NOTE)
