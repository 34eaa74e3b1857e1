"""The server: who has access, what it refuses, and that no request can break it."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

starlette = pytest.importorskip("starlette")
from starlette.applications import Starlette  # noqa: E402
from starlette.responses import PlainTextResponse  # noqa: E402
from starlette.routing import Route  # noqa: E402

from grebe.core.errors import GrebeError, InputError  # noqa: E402
from grebe.io.store import SurveyFile  # noqa: E402
from grebe.server import library, maps, plans, views  # noqa: E402
from grebe.server.boat import Paced  # noqa: E402
from grebe.server.failures import NoMapError  # noqa: E402
from grebe.server.library import Library, UnknownSurveyError  # noqa: E402
from grebe.server.live import MissionWatch  # noqa: E402
from grebe.server.requests import parsed  # noqa: E402
from grebe.server.security import Gate, Keys  # noqa: E402
from grebe.server.tabs import PAST, QUEUE, Lease, Past, Tab, encoded_message  # noqa: E402
from grebe.server.worker import Worker  # noqa: E402

LAKE = [[6.55, 46.45], [6.551, 46.45], [6.551, 46.4506], [6.55, 46.4506], [6.55, 46.45]]
REGION = {"type": "Polygon", "coordinates": [LAKE]}
HOSTS = frozenset({"127.0.0.1:8737"})


async def ask(app, path="/api/x", method="GET", **headers):
    """Send a request to an ASGI app without a socket; return status and headers."""
    status, headers, _ = await on_event(app, path, method, b"", **headers)
    return status, headers


async def on_event(app, path, method, sent, **headers):
    """Send a request with a body; return status, headers and body."""
    heard = []
    scope = {
        "type": "http", "method": method, "path": path.partition("?")[0], "raw_path": b"",
        "query_string": path.partition("?")[2].encode(), "http_version": "1.1", "scheme": "http",
        "headers": [(k.replace("_", "-").encode(), v.encode()) for k, v in headers.items()],
        "server": ("127.0.0.1", 8737), "client": ("127.0.0.1", 1), "root_path": "",
    }  # fmt: skip

    asked = []

    async def receive():
        # The client waits for the answer and never disconnects by itself.
        if asked:
            await asyncio.Event().wait()
        asked.append(True)
        return {"type": "http.request", "body": sent, "more_body": False}

    async def send(message):
        heard.append(message)

    await app(scope, receive, send)
    said = {k.decode(): v.decode() for k, v in heard[0]["headers"]}
    return heard[0]["status"], said, b"".join(one.get("body", b"") for one in heard[1:])


@pytest.fixture
def gate(tmp_path):
    async def fine(_):
        return PlainTextResponse("fine")

    inner = Starlette(
        routes=[Route(path, fine, methods=["GET", "POST"]) for path in ("/", "/api/x")]
    )
    keys = Keys(tmp_path, 8737)
    return Gate(inner, keys, HOSTS), keys


def run(coroutine):
    """Run in a thread, because browser tests in the same process keep an event loop running."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, coroutine).result()


def test_the_launch_token_is_exchanged_once_for_a_cookie_of_this_site_alone(gate):
    app, keys = gate
    opened, headers = run(ask(app, f"/?token={keys.launch_token}", host="127.0.0.1:8737"))
    assert (opened, headers["location"]) == (303, "/")
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]
    again, headers = run(ask(app, f"/?token={keys.launch_token}", host="127.0.0.1:8737"))
    assert again == 401
    assert "set-cookie" not in headers


def test_a_page_that_is_open_knows_a_server_that_was_started_again(tmp_path):
    assert Keys(tmp_path, 8737).cookie == Keys(tmp_path, 8737).cookie
    assert Keys(tmp_path, 8737).launch_token != Keys(tmp_path, 8737).launch_token
    assert (tmp_path / ".grebe-app").stat().st_mode & 0o077 == 0


ATTACKS = {
    "no cookie": ({"cookie": ""}, 401),
    "another's cookie": ({"cookie": "grebe_8737=guess"}, 401),
    "a name that points here": ({"host": "evil.example:8737"}, 403),
    "another port's page": ({"origin": "http://127.0.0.1:9999"}, 403),
    "another site's page": ({"origin": "https://evil.example"}, 403),
    "an opaque origin": ({"origin": "null"}, 403),
    "a cross-site fetch": ({"sec_fetch_site": "cross-site"}, 403),
    "a form's content type": ({"content_type": "text/plain"}, 415),
    "no content type": ({"content_type": ""}, 415),
    "an unreadable cookie": ({"cookie": 'a="\x01'}, 401),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_does_not_come_from_its_own_page_is_refused(gate, attack):
    app, keys = gate
    good = {
        "host": "127.0.0.1:8737",
        "cookie": f"{keys.cookie_name}={keys.cookie}",
        "content_type": "application/json",
    }
    assert run(ask(app, method="POST", **good))[0] == 200
    worse, status = ATTACKS[attack]
    assert run(ask(app, method="POST", **{**good, **worse}))[0] == status


def test_every_answer_forbids_what_is_not_ours(gate):
    _, headers = run(ask(gate[0], "/", host="127.0.0.1:8737"))
    assert "default-src 'self'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("survey_id", ["../../etc/passwd", "", "demo.gpkg", "%2e%2e"])
def test_no_id_is_a_path(tmp_path, survey_id):
    with pytest.raises(UnknownSurveyError):
        Library(tmp_path).path(survey_id)


@given(name=st.text(max_size=200))
@settings(max_examples=30)
def test_a_new_survey_lies_in_its_folder_whatever_its_name(tmp_path_factory, name):
    folder = tmp_path_factory.getbasetemp()
    assert Library(folder).free_path(name).parent == folder


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(setting=st.sampled_from(sorted(plans.NAMES)), value=json_values)
@settings(max_examples=30)
def test_a_plan_of_nonsense_says_what_is_wrong_and_raises_nothing(setting, value):
    made = plans.preview({"region": REGION, "settings": {"cell_m": 30.0, setting: value}})
    assert made["problems"] or made["targets"]["features"]


@given(region=json_values)
@settings(max_examples=30)
def test_a_region_of_nonsense_says_what_is_wrong(region):
    [problem] = plans.preview({"region": region, "settings": {}})["problems"]
    assert problem["message"]


HUGE = 10**400


@pytest.mark.parametrize(
    "body",
    [
        b'{"x": 1e308}', b'{"x": NaN}', b'{"x": -Infinity}', str({"x": HUGE}).replace("'", '"'),
        b'{"x": "\\ud800"}', b'{"\\udfff": 1}', b"[1]", b"\xff", b"[" * 200_000, b"",
    ],
)  # fmt: skip
def test_no_json_gets_through_that_fails_behind(body):
    with pytest.raises(GrebeError):
        parsed(body if isinstance(body, bytes) else body.encode())


@given(found=st.dictionaries(st.text(max_size=8), json_values, max_size=4))
@settings(max_examples=50)
def test_json_that_gets_through_can_be_written_again(found):
    try:
        kept = parsed(json.dumps(found).encode())
    except GrebeError:
        return
    json.dumps(kept, ensure_ascii=False, allow_nan=False).encode()


@pytest.mark.parametrize("setting", ["cell_m", "speed_min_mps", "shore_margin_m", "minutes"])
@pytest.mark.parametrize("value", [HUGE, 1e308, 1e-300, -1e12, 0])
def test_a_number_beyond_all_measure_is_a_problem_of_its_setting(setting, value):
    made = plans.preview({"region": REGION, "settings": {"cell_m": 30.0, setting: value}})
    assert made["problems"] or made["targets"]["features"]
    if value in (HUGE, 1e308):
        assert made["problems"][0]["setting"] == setting


OF_A_SERVER = """
import asyncio, os, signal
from grebe.server.worker import Worker
if __name__ == "__main__":
    print(asyncio.run(Worker("os").run("getpid")), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def is_alive(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_the_process_beside_a_server_that_is_killed_ends_with_it(tmp_path):
    (tmp_path / "server.py").write_text(OF_A_SERVER)
    command = [sys.executable, tmp_path / "server.py"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == -signal.SIGKILL
    worker = int(done.stdout)
    assert worker != os.getpid()
    until = time.monotonic() + 10
    while is_alive(worker) and time.monotonic() < until:
        time.sleep(0.1)
    assert not is_alive(worker)


def test_the_server_leaves_to_its_processes_what_takes_long_to_import():
    seen = "import sys, grebe.server.app; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", seen], check=True, capture_output=True, text=True)
    imported = set(done.stdout.split())
    assert "grebe.server.app" in imported
    late = {"numba", "scipy", "grebe.mapping", "grebe.planning", "grebe.mission", "matplotlib"}
    assert not late & imported


def test_a_worker_that_dies_is_replaced():
    async def work():
        worker = Worker("os")
        try:
            with pytest.raises(InputError, match="too much"):
                await worker.run("_exit", 1)
            return await worker.run("fspath", "alive")
        finally:
            worker.close()

    assert run(work()) == "alive"


def test_a_preview_covers_the_water_and_stays_in_it():
    made = plans.preview({"region": REGION, "settings": {"cell_m": 10.0, "vessel": "blueboat"}})
    assert made["problems"] == []
    assert len(made["targets"]["features"]) == pytest.approx(made["area_m2"] / 100, rel=0.15)
    assert made["outside_m"] == 0
    assert made["uncovered_m2"] < 0.05 * made["area_m2"]


def test_too_many_cells_are_refused_with_a_size_that_is_not():
    asked = {"region": REGION, "settings": {"cell_m": 0.1}}
    [problem] = plans.preview(asked)["problems"]
    assert problem["setting"] == "cell_m"
    assert "choose 1 m or more" in problem["message"]


def test_a_kept_plan_is_a_survey_file_of_that_name(tmp_path):
    path = tmp_path / "kept.gpkg"
    plans.keep({"region": REGION, "settings": {"cell_m": 20.0}, "name": "Étang"}, str(path))
    [line] = Library(tmp_path).summaries()
    assert (line["name"], line["state"], line["reached"]) == ("Étang", "planned", 0)
    shown = views.detail(line["id"], path)
    assert len(shown["targets"]) == line["cells"]
    json.dumps(shown, allow_nan=False)
    json.dumps(views.snapshot(line["id"], path), allow_nan=False)


def test_a_slow_tab_gets_a_snapshot_instead_of_a_queue():
    tab = Tab(name="slow")
    for _ in range(3 * QUEUE):
        tab.send(encoded_message("delta", {}))
    assert tab.behind
    assert tab.queue.qsize() == QUEUE


@given(told=st.integers(0, PAST + 50), missed=st.integers(0, PAST + 50))
def test_a_reconnecting_tab_gets_what_it_missed_and_nothing_twice(told, missed):
    past = Past()
    numbers = [past.number]
    for count in range(told):
        past.add("delta", {"n": count})
        numbers.append(past.number)
    missed = min(missed, told)
    found = past.since(numbers[told - missed])
    if missed > PAST:
        assert found is None
    else:
        assert found is not None
        sent = [json.loads(one.text.split(b"data: ")[1])["n"] for one in found]
        assert sent == list(range(told - missed, told))


@given(number=st.text(max_size=30) | st.builds("{}.{}".format, st.text(max_size=9), st.integers()))
def test_an_unknown_message_number_gets_a_snapshot(number):
    past = Past()
    past.add("delta", {})
    assert past.since(number) is None
    before = past.number
    past.forget()
    assert past.since(before) is None


def test_one_page_steers_and_all_are_shown_which():
    lease = Lease()
    lease.take("a")
    assert (lease.seen_by("a")["holder"], lease.seen_by("b")["holder"]) == ("you", "other")
    lease.leave("b")
    assert lease.holder == "a"
    lease.take("b")
    assert lease.seen_by("a")["holder"] == "other"


@pytest.fixture
def served(tmp_path):
    """A server with one survey, as a function of path (after its id), method, body and tab."""
    from grebe.server.app import make_app

    plans.keep_demo(str(tmp_path / "demo.gpkg"))
    keys = Keys(tmp_path, 8737)
    app = make_app(tmp_path, keys, HOSTS)
    base = f"/api/surveys/{library.identity(tmp_path / 'demo.gpkg')}"

    def asked(path, method="GET", body=b"{}", tab="a"):
        headers = {
            "host": "127.0.0.1:8737", "authorization": f"Bearer {keys.bearer}",
            "content_type": "application/json", "x_grebe_tab": tab,
        }  # fmt: skip
        whole = path if path.startswith("/api") else base + path
        status, _, answer = run(on_event(app, whole, method, body, **headers))
        return status, json.loads(answer or b"null")

    return asked


def test_who_does_not_steer_may_stop_and_nothing_else(served):
    assert served("/api/lease", "POST", b'{"take": true}', "a")[1]["holder"] == "you"
    for command in ("pause", "continue", "return"):
        status, answer = served(f"/{command}", "POST", tab="b")
        assert (status, answer["error"]["code"]) == (409, "Conflict")
    # The page may stop, but there is no mission to stop.
    status, answer = served("/stop", "POST", tab="b")
    assert (status, answer["error"]["code"]) == (409, "Link")


def test_a_real_boat_is_confirmed_and_one_of_ones_own_is_not_sailed_from_a_page(served):
    body = json.dumps({"link": "mavlink:udp:127.0.0.1:1"}).encode()
    assert served("/run", "POST", body)[1]["error"]["setting"] == "confirm"
    body = json.dumps({"link": "python:os:system", "confirm": True}).encode()
    assert served("/run", "POST", body)[0] == 400


PATHS = st.sampled_from(["", "/replay", "/preflight?link=foo", "/report", "/map/x", "/nothing"])
BODIES = st.one_of(
    st.binary(max_size=20),
    st.dictionaries(
        st.sampled_from(["take", "rate", "weather", "rule", "language", "name", "x"]), json_values
    ).map(lambda found: json.dumps({**found, "link": "foo"}).encode()),
)


@given(
    path=PATHS | st.sampled_from(["/api/lease", "/api/surveys", "/run", "/pause", "/stop"]),
    method=st.sampled_from(["GET", "POST", "PUT", "PATCH"]),
    body=BODIES,
)
@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_whatever_is_asked_the_answer_is_never_that_the_server_failed(served, path, method, body):
    status, _ = served(path, method, body)
    assert status < 500


@pytest.mark.slow
def test_what_a_mission_publishes_is_what_its_file_holds(simulated_survey):
    path, _, told = simulated_survey
    with SurveyFile.open(path) as file:
        reached, samples = file.progress().reached, file.count("samples")
    assert sum(word == "reached" for one in told for _, word in one.get("targets", ())) == reached
    assert sum(len(one.get("samples", ())) for one in told) == samples
    assert told[-1]["status"]["state"] == "complete"
    assert views.snapshot("x", path)["status"]["state"] == "complete"
    for one in told:
        json.dumps(one, allow_nan=False)


@pytest.mark.slow
def test_a_page_that_looks_on_late_counts_no_sample_twice(simulated_survey):
    path, _, told = simulated_survey
    watch = MissionWatch("x", path, Lease())
    watch.state = views.snapshot("x", path)
    count = watch.state["status"]["samples"]
    # The file was read after the mission had sent the last of these.
    for one in told[-50:]:
        watch._apply_lists(one, {}, 0.0)
    assert watch.state["status"]["samples"] == count
    later = {**told[-1], "samples": [[watch.state["sampled"] + 1, 6.5, 46.4, [1.0] * 20]]}
    watch._apply_lists(later, {}, 0.0)
    assert watch.state["status"]["samples"] == count + 1


@pytest.mark.slow
def test_targets_are_known_by_their_numbers_and_not_by_their_places(simulated_survey):
    """A revision changes the order; a page must not mark the neighbours of a target."""
    path, _, _ = simulated_survey
    watch = MissionWatch("x", path, Lease())
    watch.state = views.snapshot("x", path)
    targets = watch.state["targets"] = [
        {**one, "state": "open"} for one in reversed(watch.state["targets"])
    ]
    watch._apply_lists({"targets": [[targets[0]["seq"], "reached"]]}, {}, 0.0)
    assert [one["state"] for one in targets] == ["reached"] + ["open"] * (len(targets) - 1)


@pytest.mark.slow
def test_a_map_is_read_where_there_is_water_alone(simulated_survey):
    path, survey, _ = simulated_survey
    lon, lat = survey.frame.to_wgs84((0.0, 0.0)).tolist()
    read = maps.at(str(path), "ph", lon, lat, forming=False)
    assert read["low"] < read["mean"] < read["high"]
    made = maps._made(str(path), "ph", forming=False)
    row, column = np.argwhere(made.map.grid.inside)[7]
    node = (made.map.grid.north[row], made.map.grid.east[column])
    there = maps.at(str(path), "ph", *survey.frame.to_wgs84(node).tolist(), forming=False)
    assert there["mean"] == pytest.approx(made.map.mean[row, column], rel=1e-6)
    assert there["sd"] == pytest.approx(made.map.sd[row, column], rel=1e-6)
    with pytest.raises(NoMapError):
        maps.at(str(path), "ph", lon + 1.0, lat, forming=False)
    grid = maps.grid(str(path), "ph", "probability", read["mean"], "above", forming=False)
    assert grid["range"] == [0.0, 1.0]


def test_a_paced_boat_takes_its_time(monkeypatch):
    from grebe.links.base import Observation
    from grebe.server import boat

    clock, slept = [0.0], []
    monkeypatch.setattr(boat.time, "monotonic", lambda: clock[0])

    def sleep(seconds):
        slept.append(seconds)
        clock[0] += seconds

    monkeypatch.setattr(boat.time, "sleep", sleep)

    class Link:
        times = iter((0.0, 0.1, 0.2, 0.3))

        def observe(self):
            return Observation(time_s=next(self.times), state=(0.0,) * 6)

    paced = Paced(Link(), rate=2.0)
    for _ in range(4):
        paced.observe()
    assert sum(slept) == pytest.approx(0.15)


def test_an_opened_outline_says_what_is_doubtful_about_it(tmp_path):
    """Two polygons in one lake that nothing calls islands: the boat would be sent across them."""
    shore = np.array(LAKE)
    inside = [shore[0] + 0.2 * (shore - shore[0]) + [0.0003, 0.0002], shore]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [r]}}
        for r in (one.tolist() for one in reversed(inside))
    ]
    path = tmp_path / "lake.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    told = plans.outline(str(path), "named", None)
    assert told["region"]["type"] in {"Polygon", "MultiPolygon"}
    assert any("island" in note for note in told["notes"])
    assert len(told["region"]["coordinates"]) == 1
    dry = plans.outline(str(path), "all", None)
    assert len(dry["region"]["coordinates"]) == 2
    path.write_text(json.dumps(REGION))
    assert plans.outline(str(path), "named", None)["notes"] == []
