"""How soon the app is visible: `python -m benchmarks.paint [--times N]`; Chromium and Playwright.

`grebe app` is started as a user starts it, and a browser that is already open goes to the address
as soon as it is printed. The time is from the command to the browser's own first contentful paint,
by the computer's clock in both. The first start warms the caches and is not counted.
"""

from __future__ import annotations

import argparse
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from benchmarks.web import ARGUMENTS, RUN

PAINTED = """
  () => new Promise((done) => new PerformanceObserver((list) => {
    for (const one of list.getEntries())
      if (one.name === "first-contentful-paint") done(performance.timeOrigin + one.startTime);
  }).observe({ type: "paint", buffered: true }))
"""


def painted_s(browser, folder):
    """Start the app, open its page, end it; when the address was printed and the page painted."""
    began = time.time()
    app = subprocess.Popen(
        [sys.executable, "-c", RUN, "app", "--port", "0", "--no-browser", "--dir", folder],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    page = browser.new_page()
    try:
        address = app.stdout.readline().strip()
        printed_s = time.time() - began
        page.goto(address, wait_until="commit")
        return printed_s, page.evaluate(PAINTED) / 1000 - began
    finally:
        page.close()
        app.send_signal(signal.SIGINT)
        app.wait(30)


def main():
    from playwright.sync_api import sync_playwright

    asked = argparse.ArgumentParser()
    asked.add_argument("--times", type=int, default=8)
    given = asked.parse_args()
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
        painted_s(browser, folder)
        times = []
        for _ in range(given.times):
            printed, painted = painted_s(browser, folder)
            print(f"address after {printed:.2f} s, first paint after {painted:.2f} s", flush=True)
            times.append(painted)
            time.sleep(1)
        browser.close()
    print(f"first paint: median {statistics.median(times):.2f} s, most {max(times):.2f} s")


if __name__ == "__main__":
    main()
