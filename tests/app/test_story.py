"""What a user does, from an empty folder to the report, as one story; and at phone size."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from app.waiting import until

pytestmark = pytest.mark.slow
AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1440, "height": 900}


def shown(page, selector):
    return page.locator(selector).first.inner_text()


def click_at(page, x, y):
    box = page.locator(".map").bounding_box()
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


def place(page):
    """The page's address, asked of the page itself, because the driver learns of it late."""
    return page.evaluate("location.hash")


def reached(page):
    found = re.search(r"([\d,]+)/([\d,]+)", shown(page, ".progress-text"))
    return int(found[1].replace(",", "")) if found else 0


def state(page):
    badge = page.locator(".commands .badge")
    return badge.first.inner_text() if badge.count() else "under way"


@pytest.fixture(scope="module")
def planned(context, app):
    """A survey planned by drawing; the page stays on its preflight."""
    page = context.new_page()
    page.goto(f"{app.base}#/plan")
    page.get_by_label("Go to").fill("46.45, 6.55")
    page.get_by_label("Go to").press("Enter")
    for _ in range(4):
        page.get_by_role("button", name="Zoom in").click()
        page.wait_for_timeout(350)
    page.get_by_role("button", name="Water").click()
    for x, y in ((0.42, 0.4), (0.55, 0.38), (0.6, 0.5), (0.45, 0.55)):
        click_at(page, x, y)
    page.get_by_role("button", name="Finish").click()
    until(lambda: page.locator(".facts dd").count() >= 8, "the preview of the plan")
    page.get_by_label("Name").fill("Lac d'essai")
    page.get_by_label("Cell size").fill("7")
    until(lambda: "busy" not in page.locator(".facts-box").get_attribute("class"), "the plan")
    assert page.locator("dt:text('Outside the water') + dd").inner_text() == "0 m"
    page.get_by_role("button", name="Undo").click()
    until(lambda: page.locator(".shape.water").count() == 0, "the shape is gone")
    page.get_by_role("button", name="Redo").click()
    until(lambda: page.locator(".shape.water").count() == 1, "the shape is back")
    keep = page.get_by_role("button", name="Keep this plan")
    until(keep.is_enabled, "a plan to keep")
    keep.click()
    until(lambda: "#/preflight/" in place(page), "the preflight")
    yield page
    page.close()


def test_a_survey_from_the_drawing_to_the_report(planned, app):
    page = planned
    until(lambda: page.locator(".lines li").count() >= 4, "the doctor's lines")
    survey = place(page).rpartition("/")[2]
    page.get_by_label("Speed of the simulation").fill("4")
    page.get_by_role("button", name="Start the survey").click()
    until(lambda: "#/live/" in place(page), "the live screen")
    until(lambda: reached(page) >= 2, "cells that are reached")

    page.get_by_role("button", name="Pause").click()
    until(lambda: page.get_by_role("button", name="Continue").count() == 1, "a pause")
    page.get_by_role("button", name="Continue").click()
    until(lambda: page.get_by_role("button", name="Pause").count() == 1, "going on")

    # The server is killed: the boat sails on, and the page comes back and shows everything.
    before, [pid] = reached(page), app.missions()
    app.kill()
    until(lambda: page.locator(".banner").count() == 1, "that the server is gone is said")
    os.kill(pid, 0)
    app.start()
    until(lambda: page.locator(".banner").count() == 0, "the page is back")
    until(lambda: reached(page) > before, "what the boat did meanwhile")
    assert app.missions() == [pid]

    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    until(lambda: state(page) == "Stopped", "the stop")
    done = reached(page)

    page.get_by_role("button", name="Resume the survey").click()
    until(lambda: page.locator(".lines li").count() >= 4, "the doctor's lines")
    page.get_by_label("Speed of the simulation").fill("60")
    page.get_by_role("button", name="Resume the survey").click()
    until(lambda: "#/live/" in place(page), "the live screen: " + shown(page, ".notices"))
    until(lambda: reached(page) >= done, "going on")
    until(lambda: state(page) == "Complete", "the end of the survey", 240.0)
    read_the_map(page)
    replay_it(page, app, survey)
    report_it(page, app, survey)


def read_the_map(page):
    page.get_by_role("button", name="Open the map").click()
    until(lambda: page.locator(".legend").count() == 1, "the map")
    until(lambda: click_at(page, 0.5, 0.5) or page.locator(".big").count(), "a value at a place")
    assert re.search(r"95 % interval: [\d.,]+ – [\d.,]+", page.locator(".reading").inner_text())
    page.get_by_label("Layer").select_option("sd")
    until(lambda: page.locator(".hint").count() == 0, "the map of its doubt")
    page.get_by_role("button", name="Draw").click()
    click_at(page, 0.45, 0.5)
    click_at(page, 0.55, 0.5)
    until(lambda: page.locator(".chart canvas").count() == 1, "a profile")


def replay_it(page, app, survey):
    page.goto(f"{app.base}#/replay/{survey}")
    play = page.get_by_role("button", name="Play")
    until(play.is_enabled, "the recorded mission")
    page.get_by_label("Speed").select_option("60")
    first = shown(page, ".scrubber output")
    play.click()
    until(lambda: shown(page, ".scrubber output") != first, "the replay runs")


def report_it(page, app, survey):
    page.goto(f"{app.base}#/report/{survey}")
    page.get_by_role("button", name="Make the report").click()
    frame = page.frame_locator("iframe")
    until(lambda: page.locator("iframe").count() == 1, "the report")
    assert "Lac d'essai" in frame.locator("body").inner_text()


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("theme", ["day", "night", "sunlight"])
def test_no_screen_is_wider_than_the_window_or_hard_to_use(page, app, planned, size, theme):
    survey = place(planned).rpartition("/")[2]
    page.set_viewport_size(size)
    page.goto(app.base)
    page.evaluate(f"localStorage.setItem('grebe-theme', '{theme}')")
    page.evaluate("localStorage.setItem('grebe-language', 'en')")
    page.reload()
    cdp = page.context.new_cdp_session(page)
    for screen in ("start", "plan", "preflight", "live", "map", "replay", "report"):
        page.goto(f"{app.base}#/{screen}/{survey}")
        until(lambda: page.locator("main h1").count() >= 1, screen)
        page.wait_for_timeout(400)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"], screen
        if AXE.exists():
            assert serious(cdp) == [], f"{screen} in {theme}"


def serious(cdp):
    """The serious findings of axe, whose script the debugger injects past the content policy."""

    def run(expression):
        told = cdp.send("Runtime.evaluate", {
            "expression": expression, "awaitPromise": True, "returnByValue": True,
        })  # fmt: skip
        return told["result"].get("value")

    if run("typeof axe") != "object":
        run(AXE.read_text(encoding="utf-8"))
    return run(
        "axe.run(document, {iframes: false}).then(r => r.violations.filter(v => "
        "['serious', 'critical'].includes(v.impact)).map(v => v.id + ': ' + "
        "v.nodes.slice(0, 3).map(n => n.html.slice(0, 120)).join(' | ')))"
    )


def test_the_keyboard_alone_draws_a_lake(page, app):
    page.goto(f"{app.base}#/plan")
    page.reload()
    page.get_by_role("button", name="Water").press("Enter")
    for keys in ("Enter", "ArrowRight Enter", "ArrowDown Enter", "ArrowLeft Enter"):
        for key in keys.split():
            page.keyboard.press(key)
            page.wait_for_timeout(500)
    page.keyboard.press("f")
    until(lambda: page.locator(".shape.water").count() == 1, "a shape")


def test_another_page_cannot_steer_unless_it_takes_over(context, app, planned):
    survey = place(planned).rpartition("/")[2]
    one, other = context.new_page(), context.new_page()
    for page in (one, other):
        page.goto(f"{app.base}#/live/{survey}")
        until(lambda page=page: page.locator(".lease").count() == 1, "the live screen")
    one.get_by_role("button", name="Take over").click()
    until(lambda: shown(one, ".lease span") == "You steer", "the lease")
    until(lambda: shown(other, ".lease span") == "Another page steers", "the lease is seen")
    other.get_by_role("button", name="Take over").click()
    until(lambda: shown(one, ".lease span") == "Another page steers", "taken over on purpose")
    one.close()
    other.close()
