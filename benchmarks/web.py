"""The page of the app under load: `python -m benchmarks.web`; needs Chromium and Playwright.

A survey of some ten thousand cells with fifty thousand points of track is sailed in simulation at
the clock's own rate, which gives ten messages a second. Headless Chromium without a GPU shows it
on 1440 x 900. Frames are counted by the browser's own animation frames while the map is dragged.
The page's share of a core is the browser's TaskDuration, which includes waiting on a busy machine.
The time from event to pixel is from when the mission's process heard the oldest event of a message
to the frame after the page has taken it in.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import shapely

from grebe.core.events import Step
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region
from grebe.workflow.files import write_survey

STATIC = Path(__file__).parents[1] / "src" / "grebe" / "server" / "static"
RUN = "from grebe.cli.main import main; main()"
ARGUMENTS = ["--no-sandbox", "--headless", "--disable-gpu", "--disable-background-networking"]
POINTS, SIDE_M, CELL_M = 50_000, 500.0, 5.0


def survey_file(path):
    """Ten thousand cells, none of them reached, and a long track over them."""
    frame = LocalFrame(origin_lon_deg=6.55, origin_lat_deg=46.45)
    half = SIDE_M / 2
    region = Region(name="Large", frame=frame, water=shapely.box(-half, -half, half, half))
    survey = plan_survey(region, PRESETS["blueboat"], PlanSettings(cell_m=CELL_M, pattern="rows"))
    write_survey(path, survey)
    began = datetime.now(UTC) - timedelta(seconds=POINTS)
    with SurveyFile.open(path) as file, file.together():
        first = Step(time=began, elapsed_s=0.0, state=(0.0,) * 6, thrusts=(1.0, 1.0))
        for k in range(POINTS):
            lane, along = divmod(k * 0.5, SIDE_M)
            east = along - half if int(lane) % 2 else half - along
            north = float(np.clip(-half + lane * 10.0 + 3 * np.sin(k / 20), -half, half))
            state = (north, east, 1.57, 1.0, 0.0, 0.0)
            file.append_track(replace(first, time=began + timedelta(seconds=k), state=state))
    return len(survey.targets)


# Records the age of each message when the frame after it has been painted [ms].
WATCH = """
  window.ages_ = [];
  const listen = EventSource.prototype.addEventListener;
  EventSource.prototype.addEventListener = function (kind, act, ...more) {
    return listen.call(this, kind, (event) => {
      act(event);
      if (kind !== "delta") return;
      const { heard } = JSON.parse(event.data);
      requestAnimationFrame(() => setTimeout(() => window.ages_.push(Date.now() - 1000 * heard)));
    }, ...more);
  };
"""


def main():
    from playwright.sync_api import sync_playwright

    scripts = sum(len(gzip.compress(p.read_bytes(), 9)) for p in STATIC.glob("assets/*.js"))
    print(f"JavaScript, compressed: {scripts / 1000:.0f} kB")
    with tempfile.TemporaryDirectory() as folder:
        print("cells:", survey_file(Path(folder) / "large.gpkg"), "points:", POINTS)
        began = time.monotonic()
        app = subprocess.Popen(
            [sys.executable, "-c", RUN, "app", "--no-browser", "--port", "0", "--dir", folder],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        address = app.stdout.readline().strip()
        print(f"address printed after {time.monotonic() - began:.2f} s")
        try:
            with sync_playwright() as playwright:
                chromium = playwright.chromium.launch(
                    executable_path=shutil.which("chromium"), args=ARGUMENTS
                )
                page = chromium.new_page(viewport={"width": 1440, "height": 900})
                page.add_init_script(WATCH)
                measure(page, address)
                chromium.close()
        finally:
            for live in Path(folder).glob("*.live"):
                os.kill(json.loads(live.read_text())["pid"], signal.SIGTERM)
            app.terminate()
            app.wait()


def measure(page, address):
    page.goto(address)
    page.wait_for_timeout(1000)
    survey = page.evaluate("fetch('/api/surveys').then(r => r.json()).then(s => s[0].id)")
    page.evaluate(
        "id => fetch(`/api/surveys/${id}/run`, {method: 'POST', headers: {'Content-Type': "
        "'application/json', 'X-Grebe-Tab': sessionStorage.getItem('grebe-tab')}, "
        "body: JSON.stringify({link: 'simulated', rate: 1, resume: true})}).then(r => r.json())",
        survey,
    )
    page.goto(address.partition("?")[0] + f"#/live/{survey}")
    page.wait_for_timeout(10_000)
    cdp = page.context.new_cdp_session(page)
    cdp.send("Performance.enable")
    print(f"page at rest: {busy(cdp, lambda: page.wait_for_timeout(10_000)):.0%} of a core")
    ages = page.evaluate("window.ages_")
    print(
        f"event to pixel: median {np.median(ages):.0f} ms, 95 % within "
        f"{np.percentile(ages, 95):.0f} ms, of {len(ages)} messages"
    )
    page.evaluate(
        "() => { window.frames_ = []; const step = t => { window.frames_.push(t); "
        "requestAnimationFrame(step); }; requestAnimationFrame(step); }"
    )
    share = busy(cdp, lambda: drag(page))
    times = page.evaluate("window.frames_")
    gaps = np.diff(times)
    print(
        f"panning: {1000 / statistics.mean(gaps):.0f} frames a second, 95 % within "
        f"{np.percentile(gaps, 95):.0f} ms, the longest {gaps.max():.0f} ms, {share:.0%} of a core"
    )


def busy(cdp, work):
    def total():
        found = cdp.send("Performance.getMetrics")["metrics"]
        return next(one["value"] for one in found if one["name"] == "TaskDuration")

    before, began = total(), time.monotonic()
    work()
    return (total() - before) / (time.monotonic() - began)


def drag(page):
    for turn in range(6):
        page.mouse.move(600, 450)
        page.mouse.down()
        for k in range(60):
            page.mouse.move(600 + (-1) ** turn * 4 * k, 450 + 1.5 * k)
            time.sleep(0.012)
        page.mouse.up()
        time.sleep(0.1)


if __name__ == "__main__":
    main()
