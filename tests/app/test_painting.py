"""A dragged map paints only what comes into view, and its picture is complete all the same."""

from __future__ import annotations

import io
from datetime import timedelta

import numpy as np
import pytest
from app.waiting import until
from conftest import NOON, region_of
from PIL import Image

from grebe.core.events import Step
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey
from grebe.workflow.files import write_survey

pytestmark = pytest.mark.slow
SIDE_M = 200.0


@pytest.fixture
def sailed(app):
    """A survey with cells and a track in lanes, in which nothing moves."""
    path = app.folder / "painted.gpkg"
    region = region_of([(0, 0), (SIDE_M, 0), (SIDE_M, 0.7 * SIDE_M), (0, SIDE_M)])
    survey = plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=10, pattern="rows"))
    write_survey(path, survey)
    with SurveyFile.open(path) as file, file.together():
        for k in range(900):
            lane, along = divmod(k * 1.0, SIDE_M)
            east = along if int(lane) % 2 else SIDE_M - along
            state = (10 + 30 * lane + 3 * np.sin(k / 9), east, 0.0, 1.0, 0.0, 0.0)
            when = NOON + timedelta(seconds=k)
            file.append_track(Step(time=when, elapsed_s=float(k), state=state, thrusts=(1.0, 1.0)))
    yield region.name
    path.unlink()


def seen(page):
    """The middle of the window, without the panels over the map."""
    box = page.locator(".map").bounding_box()
    middle = {
        "x": box["x"] + 0.15 * box["width"], "y": box["y"] + 0.25 * box["height"],
        "width": 0.55 * box["width"], "height": 0.5 * box["height"],
    }  # fmt: skip
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=middle))).convert("RGB"), int)


def drag(page, right, down):
    page.mouse.move(600, 450)
    page.mouse.down()
    for k in range(1, 21):
        page.mouse.move(600 + right * k / 20, 450 + down * k / 20)
        page.wait_for_timeout(10)
    # Release it at rest, so that the map does not coast.
    page.wait_for_timeout(250)
    page.mouse.up()
    page.wait_for_timeout(100)


def test_a_dragged_map_is_the_map_that_would_be_painted_whole(page, app, sailed):
    page.goto(app.base)
    surveys = page.evaluate("fetch('/api/surveys').then(r => r.json())")
    survey = next(one["id"] for one in surveys if one["name"] == sailed)
    page.goto(f"{app.base}#/replay/{survey}")
    until(page.get_by_role("button", name="Play").is_enabled, "the recorded mission")
    page.locator(".scrubber input[type=range]").press("End")
    for _ in range(2):
        page.get_by_role("button", name="Zoom in").click()
        page.wait_for_timeout(400)
    began = seen(page)
    for right, down in ((-350, 160), (200, -240), (-150, -90), (420, 210)):
        drag(page, right, down)
        followed = seen(page)
        # A change of theme paints everything, and so does the change back.
        page.get_by_label("Theme").select_option("night")
        page.wait_for_timeout(200)
        page.get_by_label("Theme").select_option("day")
        page.wait_for_timeout(300)
        whole = seen(page)
        assert np.mean(np.abs(followed - whole).max(axis=-1) > 40) < 2e-3
    assert np.mean(np.abs(seen(page) - began).max(axis=-1) > 40) > 0.01
