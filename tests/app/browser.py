"""A browser and the app as a person uses them: `grebe app` in a process, Debian's Chromium."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from app.waiting import until

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
ARGUMENTS = ["--no-sandbox", "--headless", "--disable-gpu", "--disable-background-networking"]
RUN = "from grebe.cli.main import main; main()"


def free_port() -> int:
    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        return door.getsockname()[1]


class App:
    """`grebe app` on a folder; it can be killed and started again on the same port."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.process: subprocess.Popen[str] | None = None
        self.address = ""

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", RUN, "app", "--no-browser",
             "--port", str(self.port), "--dir", self.folder],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        self.address = self.process.stdout.readline().strip()
        if not self.address.startswith("http"):
            raise RuntimeError(self.process.stderr.read())
        until(self.answers, "the app answers")

    def answers(self) -> bool:
        with socket.socket() as door:
            return door.connect_ex(("127.0.0.1", self.port)) == 0

    def kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()
            self.process.stderr.close()
            self.process = None

    def missions(self) -> list[int]:
        import json

        return [json.loads(p.read_text())["pid"] for p in self.folder.glob("*.live")]

    def end(self) -> None:
        for pid in self.missions():
            os.kill(pid, signal.SIGKILL)
        self.kill()


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed (apt-get install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def app(tmp_path_factory):
    from grebe.workflow.kernel_cache import compile_controller

    compile_controller()
    made = App(tmp_path_factory.mktemp("surveys"))
    made.start()
    yield made
    made.end()


@pytest.fixture(scope="session")
def context(browser, app):
    """A browser that has opened the app by its launch address."""
    made = browser.new_context(viewport={"width": 1440, "height": 900}, locale="en-GB")
    page = made.new_page()
    page.goto(app.address)
    assert page.url == app.base
    page.close()
    yield made
    made.close()


@pytest.fixture
def page(context):
    made = context.new_page()
    said = []
    made.on("pageerror", lambda error: said.append(str(error)))
    made.on("request", lambda r: said.append(r.url) if "127.0.0.1" not in r.url
            and not r.url.startswith(("data:", "blob:")) else None)  # fmt: skip
    yield made
    assert not said, "an error in the page, or a request to the outside"
    made.close()
