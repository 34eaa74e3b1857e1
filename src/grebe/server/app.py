"""The server application: the handlers of all requests from the page and from scripts."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import resources
from importlib.metadata import version
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

from grebe.core.errors import GrebeError, UsageError
from grebe.server import choices, endpoints, library, requests, views
from grebe.server.background import DEEPEST, Background
from grebe.server.failures import ConflictError, failed, missing
from grebe.server.library import Library, UnknownSurveyError
from grebe.server.live import UNDER_WAY, Fleet
from grebe.server.mission_request import voyage_asked
from grebe.server.security import Gate, Keys
from grebe.server.tabs import Tab
from grebe.server.worker import Worker

REPORT_HEADERS = {
    "content-security-policy": "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "frame-ancestors 'self'",
    "cache-control": "no-store",
}
# A tile does not change while the server runs.
TILE_HEADERS = {"cache-control": "private, max-age=86400"}

# Preparations for later work wait this long, until the first page has been drawn [s].
AFTER_PAINT_S = 3.0


@dataclass
class App:
    """The state that the handlers share, and one handler per request."""

    fleet: Fleet
    surveys: Library
    plans: Worker
    maps: Worker
    background: Background | None = None

    async def description(self, _: Request) -> Response:
        """The description of the interface, for programs."""
        return JSONResponse(endpoints.description(version("grebe")))

    async def tile(self, request: Request) -> Response:
        """A tile of the user's own map."""
        place = [request.path_params[name] for name in ("zoom", "x", "y")]
        if self.background is None or not all(one.isascii() and one.isdigit() for one in place):
            raise UnknownSurveyError("There is no background map.")
        zoom, x, y = (int(one[:10]) for one in place)
        data: bytes | None = None
        if zoom <= DEEPEST and max(x, y) < 2**zoom:
            data = await run_in_threadpool(self.background.tile, zoom, x, y)
        if not data:
            return Response(status_code=204, headers=TILE_HEADERS)
        kind = self.background.about.media_type
        return Response(data, media_type=kind, headers=TILE_HEADERS)

    # Surveys.

    async def options(self, _: Request) -> Response:
        """The choices of the app, with limits and defaults."""
        return JSONResponse(choices.options(self.background))

    async def list(self, _: Request) -> Response:
        """The surveys of the folder."""
        found = await run_in_threadpool(self.surveys.summaries)
        for one in found:
            one["state"] = self.fleet.state(one["id"]) or one["state"]
        return JSONResponse(found)

    async def one(self, request: Request) -> Response:
        """The details of a survey."""
        survey_id = request.path_params["id"]
        path = self.surveys.path(survey_id)
        found = await run_in_threadpool(views.detail, survey_id, path)
        found["state"] = self.fleet.state(survey_id) or found["state"]
        return JSONResponse(found)

    async def remove(self, request: Request) -> Response:
        """Delete a survey."""
        survey_id = request.path_params["id"]
        path = self.surveys.path(survey_id)
        watch = self.fleet.watch(survey_id)
        await watch.ready()
        if watch.under_way:
            raise ConflictError("This survey is under way; stop it before you delete it.")
        await run_in_threadpool(self.surveys.remove, path)
        self.fleet.forget(survey_id)
        return Response(status_code=204)

    async def file(self, request: Request) -> Response:
        """The survey file itself."""
        path = self.surveys.path(request.path_params["id"])
        return FileResponse(path, filename=path.name, media_type="application/geopackage+sqlite3")

    async def upload(self, request: Request) -> Response:
        """Store an uploaded file as a survey."""
        async with requests.uploaded(request, self.surveys.folder) as path:
            to = self.surveys.free_path(Path(request.query_params["name"]).stem)
            await self.plans.run("receive", str(path), str(to))
        return await self._summary(to)

    async def outline(self, request: Request) -> Response:
        """The water in an uploaded file of outlines."""
        async with requests.uploaded(request, self.surveys.folder) as path:
            query = request.query_params
            islands, crs = query.get("islands") or "named", query.get("crs") or None
            found = await self.plans.run("outline", str(path), islands, crs)
        found["name"] = Path(query["name"]).stem[:80]
        return JSONResponse(found)

    async def demo(self, _: Request) -> Response:
        """Make a new survey of the demo's hectare."""
        to = self.surveys.free_path("demo")
        await self.plans.run("keep_demo", str(to))
        return await self._summary(to)

    async def _summary(self, path: Path) -> Response:
        survey_id = library.identity(path)
        found = await run_in_threadpool(self.surveys.summary, survey_id, path)
        return JSONResponse(found, status_code=201)

    # Plans.

    async def preview(self, request: Request) -> Response:
        """Plan a survey without storing it."""
        return JSONResponse(await self.plans.run("preview", await requests.body_of(request)))

    async def keep(self, request: Request) -> Response:
        """Plan a survey and store it."""
        given = await requests.body_of(request)
        to = self.surveys.free_path(str(given.get("name", "survey")))
        await self.plans.run("keep", given, str(to))
        return await self._summary(to)

    # Missions.

    async def preflight(self, request: Request) -> Response:
        """The doctor's checks."""
        path = self.surveys.path(request.path_params["id"])
        link = request.query_params.get("link", "simulated")
        return JSONResponse(await run_in_threadpool(choices.preflight, path, link))

    async def run(self, request: Request) -> Response:
        """Begin a mission, or resume one."""
        given = await requests.body_of(request)
        watch = self.fleet.watch(request.path_params["id"])
        voyage = voyage_asked(given)
        if voyage.link != "sim:" and given.get("confirm") is not True:
            raise UsageError("Sailing a real boat needs your confirmation.", settings=("confirm",))
        tab = requests.tab_of(request)
        if self.fleet.lease.holder is None:
            self.fleet.lease.take(tab)
            self.fleet.send_lease()
        self._steers(tab)
        await watch.begin(voyage)
        return JSONResponse(watch.snapshot(tab)["status"], status_code=201)

    async def order(self, request: Request) -> Response:
        """Pause, continue, return home or stop a mission; every page may stop it."""
        watch = self.fleet.watch(request.path_params["id"])
        tab = requests.tab_of(request)
        command = request.url.path.rpartition("/")[2]
        if command != "stop":
            self._steers(tab)
        await watch.order(command)
        return JSONResponse(watch.snapshot(tab)["status"])

    def _steers(self, tab: str) -> None:
        if self.fleet.lease.holder != tab:
            raise ConflictError("Another page steers; take over before you command the boat.")

    async def lease(self, request: Request) -> Response:
        """Take or release the right to steer."""
        given, tab = await requests.body_of(request), requests.tab_of(request)
        if given.get("take") is True:
            self.fleet.lease.take(tab)
        else:
            self.fleet.lease.leave(tab)
        self.fleet.send_lease()
        return JSONResponse(self.fleet.lease.seen_by(tab))

    async def events(self, request: Request) -> Response:
        """The event stream of a survey: a snapshot, then the changes."""
        watch = self.fleet.watch(request.path_params["id"])
        tab = Tab(name=requests.tab_of(request))
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        stream = watch.stream(tab, request.headers.get("last-event-id", ""))
        return StreamingResponse(stream, media_type="text/event-stream", headers=headers)

    # Maps.

    async def _path_forming(self, request: Request) -> tuple[str, bool]:
        survey_id = request.path_params["id"]
        path = self.surveys.path(survey_id)
        return str(path), self.fleet.state(survey_id) in UNDER_WAY

    async def grid(self, request: Request) -> Response:
        """A layer of a map."""
        path, forming = await self._path_forming(request)
        given = request.query_params
        threshold = (
            requests.number(given["threshold"], "threshold") if "threshold" in given else None
        )
        found = await self.maps.run(
            "grid", path, given.get("quantity", ""), given.get("layer", "mean"), threshold,
            given.get("side", "above"), forming=forming,
        )  # fmt: skip
        return JSONResponse(found)

    async def at(self, request: Request) -> Response:
        """The value at a place."""
        path, forming = await self._path_forming(request)
        given = request.query_params
        lon, lat = (requests.number(given.get(name, ""), name) for name in ("lon", "lat"))
        quantity = given.get("quantity", "")
        return JSONResponse(await self.maps.run("at", path, quantity, lon, lat, forming=forming))

    async def profile(self, request: Request) -> Response:
        """Values along a line."""
        path, forming = await self._path_forming(request)
        line = requests.line(request.query_params.get("line", ""))
        quantity = request.query_params.get("quantity", "")
        return JSONResponse(await self.maps.run("profile", path, quantity, line, forming=forming))

    async def difference(self, request: Request) -> Response:
        """The difference between two surveys."""
        path = self.surveys.path(request.path_params["id"])
        other = self.surveys.path(request.query_params.get("other", ""))
        quantity = request.query_params.get("quantity", "")
        return JSONResponse(await self.maps.run("difference", str(path), str(other), quantity))

    async def replay(self, request: Request) -> Response:
        """A recorded mission as columns."""
        path = self.surveys.path(request.path_params["id"])
        return JSONResponse(await run_in_threadpool(views.replay, path))

    async def make_report(self, request: Request) -> Response:
        """Make the report."""
        path = self.surveys.path(request.path_params["id"])
        language = (await requests.body_of(request)).get("language", "en")
        if language not in ("en", "fr"):
            raise UsageError("The report is available in en or fr.", settings=("language",))
        await self.maps.run("report", str(path), language)
        return JSONResponse({"made": datetime.now(UTC).isoformat()}, status_code=201)

    async def report(self, request: Request) -> Response:
        """The report, if it has been made."""
        page = self.surveys.path(request.path_params["id"]).with_suffix(".html")
        if not page.exists():
            raise UnknownSurveyError("The report of this survey has not been made yet.")
        return FileResponse(page, media_type="text/html", headers=REPORT_HEADERS)


class _Zipped:
    """Compresses answers, except streams of events."""

    def __init__(self, app: ASGIApp) -> None:
        self._plain = app
        self._zipped = GZipMiddleware(app, minimum_size=2000, compresslevel=5)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        streams = scope.get("path", "").endswith("/events")
        await (self._plain if streams else self._zipped)(scope, receive, send)


async def _index(_: Request) -> Response:
    page = resources.files("grebe.server") / "static" / "index.html"
    return Response(
        page.read_bytes(), media_type="text/html", headers={"cache-control": "no-cache"}
    )


def _routes(app: App) -> list[Route | Mount]:
    static = Path(str(resources.files("grebe.server"))) / "static"
    return [
        Route("/", _index),
        *(
            Route(each.path, getattr(app, each.name), methods=[each.method])
            for each in endpoints.ENDPOINTS
        ),
        Mount("/", StaticFiles(directory=static)),
    ]


def make_app(
    folder: Path, keys: Keys, hosts: frozenset[str], background: Background | None = None
) -> ASGIApp:
    """The complete server for a folder of surveys; it answers only requests to one of `hosts`."""
    surveys = Library(folder)
    app = App(
        fleet=Fleet(surveys),
        surveys=surveys,
        plans=Worker("grebe.server.plans"),
        maps=Worker("grebe.server.maps"),
        background=background,
    )

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None]:
        asyncio.get_running_loop().call_later(AFTER_PAINT_S, app.maps.begin, "warm")
        yield
        for pool in (app.plans, app.maps):
            pool.close()

    inner = Starlette(
        routes=_routes(app),
        lifespan=lifespan,
        exception_handlers={GrebeError: failed, 404: missing, 405: missing},
    )
    return Gate(_Zipped(inner), keys, hosts)
