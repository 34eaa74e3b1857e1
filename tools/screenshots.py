"""Make the pictures of the app for README and docs: `python tools/screenshots.py`.

Needs Chromium and Playwright. It starts a simulated survey of the demo's hectare and takes pictures
of the page on a desktop and on a phone, by day and by night.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page, sync_playwright

DOCS = Path(__file__).resolve().parents[1] / "docs" / "app"
RUN = "from grebe.cli.main import main; main()"
ARGUMENTS = ["--no-sandbox", "--headless", "--disable-gpu", "--disable-background-networking"]
DESK, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}


def main() -> None:
    """Start the app in a temporary folder, and take the pictures."""
    DOCS.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        app = subprocess.Popen(
            [sys.executable, "-c", RUN, "app", "--no-browser", "--demo", "--port", "0",
             "--dir", folder],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert app.stdout is not None
        try:
            draw(app.stdout.readline().strip(), Path(folder))
        finally:
            app.terminate()
            app.wait()
            for live in Path(folder).glob("*.live"):
                os.kill(json.loads(live.read_text())["pid"], signal.SIGTERM)


def draw(address: str, folder: Path) -> None:
    """Take a picture of every screen that the docs show; the live ones at half of the survey."""
    base = address.partition("?")[0]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=ARGUMENTS
        )
        context = chromium.new_context(viewport=DESK, locale="en-GB", has_touch=True)
        page = context.new_page()
        page.goto(address)
        survey = ask(page, "GET", "/api/surveys")[0]["id"]
        page.goto(f"{base}#/preflight/{survey}")
        time.sleep(3)
        picture(page, "preflight")
        run = {"link": "simulated", "rate": 20}
        ask(page, "POST", f"/api/surveys/{survey}/run", run)
        page.goto(f"{base}#/live/{survey}")
        while covered(page) < 50:
            time.sleep(0.5)
        picture(page, "live")
        night(page, "night")
        page.set_viewport_size(PHONE)
        page.reload()
        time.sleep(8)
        picture(page, "live-phone")
        page.set_viewport_size(DESK)
        night(page, "day")
        while any(folder.glob("*.live")):
            time.sleep(1)
        page.goto(f"{base}#/map/{survey}")
        until_there(page, ".legend")
        page.locator(".map").click(position={"x": 420, "y": 380})
        until_there(page, ".reading .big")
        picture(page, "map")
        page.goto(f"{base}#/replay/{survey}")
        until_there(page, ".event-list li")
        page.get_by_label("Speed").select_option("60")
        page.get_by_role("button", name="Play").click()
        time.sleep(5)
        picture(page, "replay")
        page.goto(f"{base}#/plan/{survey}")
        until_there(page, ".facts dd")
        time.sleep(1)
        picture(page, "plan")
        chromium.close()


def night(page: Page, theme: str) -> None:
    """Set the theme, which may be day or night, and reload the page."""
    page.evaluate(f"localStorage.setItem('grebe-theme', '{theme}')")
    page.reload()


def until_there(page: Page, selector: str) -> None:
    """Wait for an element, at most a minute."""
    for _ in range(300):
        if page.locator(selector).count():
            return
        time.sleep(0.2)
    raise SystemExit(f"{selector} did not come.")


def covered(page: Page) -> float:
    """The share of cells that are reached [%]."""
    return float(page.locator(".meter").get_attribute("aria-valuenow") or 0)


def ask(page: Page, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
    """Send a request to the server as the page does, and return its JSON answer."""
    return page.evaluate(
        "async ([method, path, body]) => (await fetch(path, {method, headers: {'Content-Type': "
        "'application/json', 'X-Grebe-Tab': sessionStorage.getItem('grebe-tab')}, "
        "body: body && JSON.stringify(body)})).json()",
        [method, path, body],
    )


def picture(page: Page, name: str) -> None:
    """Save a picture of the page with 256 colours, which suffice for it and keep the file small."""
    path = DOCS / f"{name}.png"
    page.screenshot(path=path)
    with Image.open(path) as image:
        image.convert("RGB").quantize(256).save(path, optimize=True)
    print(path)


if __name__ == "__main__":
    main()
