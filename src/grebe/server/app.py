"""The server's routes: what the page and scripts ask for, and who answers."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

from grebe.core.errors import GrebeError, LinkError, UsageError
from grebe.core.plan_settings import PATTERNS
from grebe.core.quantities import BUILTIN
from grebe.server import asked, library, maps, plans
from grebe.server.boat import Voyage
from grebe.server.library import Library, UnknownSurveyError
from grebe.server.live import UNDER_WAY, Fleet, Tab
from grebe.server.security import Gate, Keys
from grebe.server.worker import Worker

REPORT_HEADERS = {
    "content-security-policy": "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "frame-ancestors 'self'",
    "cache-control": "no-store",
}
STATUS = {UnknownSurveyError: 404, maps.NoMapError: 404, LinkError: 409}


@dataclass
class App:
    """What the routes share."""

    fleet: Fleet
    surveys: Library
    plan_pool: Worker
    map_pool: Worker

    async def plan(self, work: Callable[..., Any], *given: Any) -> Any:
        """Run the work of a plan in its process."""
        return await self.plan_pool.run(work, *given)

    async def map(self, work: Callable[..., Any], *given: Any, **named: Any) -> Any:
        """Run the work of a map in its process."""
        return await self.map_pool.run(functools.partial(work, *given, **named))

    # Surveys.

    async def options(self, _: Request) -> Response:
        """What can be chosen, with limits and defaults."""
        return JSONResponse(_options())

    async def list(self, _: Request) -> Response:
        """The surveys of the folder."""
        found = await run_in_threadpool(self.surveys.summaries)
        for one in found:
            one["state"] = self.fleet.state(one["id"]) or one["state"]
        return JSONResponse(found)

    async def one(self, request: Request) -> Response:
        """All about a survey, or its end."""
        survey_id = request.path_params["id"]
        path = self.surveys.path(survey_id)
        if request.method == "DELETE":
            watch = self.fleet.watch(survey_id)
            await watch.ready()
            if watch.under_way:
                raise _Conflict("This survey is under way; stop it before it is deleted.")
            await run_in_threadpool(self.surveys.remove, path)
            self.fleet.forget(survey_id)
            return Response(status_code=204)
        found = await run_in_threadpool(library.detail, survey_id, path)
        found["state"] = self.fleet.state(survey_id) or found["state"]
        return JSONResponse(found)

    async def file(self, request: Request) -> Response:
        """The survey file itself."""
        path = self.surveys.path(request.path_params["id"])
        return FileResponse(path, filename=path.name, media_type="application/geopackage+sqlite3")

    async def upload(self, request: Request) -> Response:
        """Keep a file from outside as a survey."""
        async with asked.uploaded(request, self.surveys.folder) as path:
            to = self.surveys.free_path(Path(request.query_params["name"]).stem)
            await self.plan(plans.receive, str(path), str(to))
        return await self._summary(to)

    async def outline(self, request: Request) -> Response:
        """The water of a file of outlines."""
        async with asked.uploaded(request, self.surveys.folder) as path:
            found = await self.plan(plans.outline, str(path))
        found["name"] = Path(request.query_params["name"]).stem[:80]
        return JSONResponse(found)

    async def demo(self, _: Request) -> Response:
        """A new survey of the demo's hectare."""
        to = self.surveys.free_path("demo")
        await self.plan(plans.keep_demo, str(to))
        return await self._summary(to)

    async def _summary(self, path: Path) -> Response:
        survey_id = library.identity(path)
        found = await run_in_threadpool(self.surveys.summary, survey_id, path)
        return JSONResponse(found, status_code=201)

    # Plans.

    async def preview(self, request: Request) -> Response:
        """What a survey would be."""
        return JSONResponse(await self.plan(plans.preview, await asked.body_of(request)))

    async def keep(self, request: Request) -> Response:
        """Plan a survey and keep it."""
        given = await asked.body_of(request)
        to = self.surveys.free_path(str(given.get("name", "survey")))
        await self.plan(plans.keep, given, str(to))
        return await self._summary(to)

    # Missions.

    async def preflight(self, request: Request) -> Response:
        """The lines of the doctor."""
        path = self.surveys.path(request.path_params["id"])
        link = request.query_params.get("link", "simulated")
        return JSONResponse(await run_in_threadpool(_preflight, path, link))

    async def run(self, request: Request) -> Response:
        """Begin a mission, or go on with one."""
        given = await asked.body_of(request)
        watch = self.fleet.watch(request.path_params["id"])
        voyage = _voyage(given)
        if voyage.link != "sim:" and given.get("confirm") is not True:
            raise UsageError("A real boat needs to be confirmed.", settings=("confirm",))
        tab = asked.tab_of(request)
        if self.fleet.lease.holder is None:
            self.fleet.lease.take(tab)
            self.fleet.tell_lease()
        self._steers(tab)
        await watch.begin(voyage)
        return JSONResponse(watch.snapshot(tab)["status"], status_code=201)

    async def order(self, request: Request) -> Response:
        """Pause, go on, come home; stop, which is every page's right."""
        watch = self.fleet.watch(request.path_params["id"])
        tab = asked.tab_of(request)
        command = request.url.path.rpartition("/")[2]
        if command != "stop":
            self._steers(tab)
        await watch.order(command)
        return JSONResponse(watch.snapshot(tab)["status"])

    def _steers(self, tab: str) -> None:
        if self.fleet.lease.holder != tab:
            raise _Conflict("Another page steers; take over before you command the boat.")

    async def lease(self, request: Request) -> Response:
        """Take or leave the right to steer."""
        given, tab = await asked.body_of(request), asked.tab_of(request)
        if given.get("take") is True:
            self.fleet.lease.take(tab)
        else:
            self.fleet.lease.leave(tab)
        self.fleet.tell_lease()
        return JSONResponse(self.fleet.lease.seen_by(tab))

    async def events(self, request: Request) -> Response:
        """The stream of a survey: a snapshot, then what changes."""
        watch = self.fleet.watch(request.path_params["id"])
        tab = Tab(name=asked.tab_of(request))
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(watch.stream(tab), media_type="text/event-stream", headers=headers)

    # Maps.

    async def _path_forming(self, request: Request) -> tuple[str, bool]:
        survey_id = request.path_params["id"]
        path = self.surveys.path(survey_id)
        return str(path), self.fleet.state(survey_id) in UNDER_WAY

    async def grid(self, request: Request) -> Response:
        """A layer of a map."""
        path, forming = await self._path_forming(request)
        given = request.query_params
        threshold = asked.number(given["threshold"], "threshold") if "threshold" in given else None
        found = await self.map(
            maps.grid, path, given.get("quantity", ""), given.get("layer", "mean"), threshold,
            given.get("side", "above"), forming=forming,
        )  # fmt: skip
        return JSONResponse(found)

    async def at(self, request: Request) -> Response:
        """The value at a place."""
        path, forming = await self._path_forming(request)
        given = request.query_params
        lon, lat = (asked.number(given.get(name, ""), name) for name in ("lon", "lat"))
        quantity = given.get("quantity", "")
        return JSONResponse(await self.map(maps.at, path, quantity, lon, lat, forming=forming))

    async def profile(self, request: Request) -> Response:
        """Values along a line."""
        path, forming = await self._path_forming(request)
        line = asked.line(request.query_params.get("line", ""))
        quantity = request.query_params.get("quantity", "")
        return JSONResponse(await self.map(maps.profile, path, quantity, line, forming=forming))

    async def difference(self, request: Request) -> Response:
        """What changed between two surveys."""
        path = self.surveys.path(request.path_params["id"])
        other = self.surveys.path(request.query_params.get("other", ""))
        quantity = request.query_params.get("quantity", "")
        return JSONResponse(await self.map(maps.difference, str(path), str(other), quantity))

    async def replay(self, request: Request) -> Response:
        """A recorded mission as columns."""
        path = self.surveys.path(request.path_params["id"])
        return JSONResponse(await run_in_threadpool(library.replay, path))

    async def report(self, request: Request) -> Response:
        """Make the report, or show the one that was made."""
        path = self.surveys.path(request.path_params["id"])
        page = path.with_suffix(".html")
        if request.method == "POST":
            language = (await asked.body_of(request)).get("language", "en")
            if language not in ("en", "fr"):
                raise UsageError("The report speaks en or fr.", settings=("language",))
            await self.map(maps.report, str(path), language)
            return JSONResponse({"made": datetime.now(UTC).isoformat()}, status_code=201)
        if not page.exists():
            raise UnknownSurveyError("The report of this survey has not been made yet.")
        return FileResponse(page, media_type="text/html", headers=REPORT_HEADERS)


class _Conflict(GrebeError):  # noqa: N818
    """Not now, or not by this page."""


def _options() -> dict[str, Any]:
    def setting(unit: str, default: float, low: float, high: float) -> dict[str, Any]:
        return {"unit": unit, "default": default, "min": low, "max": high}

    def both(text: str, french: str | None = None) -> dict[str, str]:
        return {"en": text, "fr": french or text}

    rules = {
        "lookahead": both("Looks ahead over many cells", "Voit plusieurs cellules devant"),
        "dual": both("Two cells at a time (the paper's)", "Deux cellules à la fois (l'article)"),
        "single": both("One cell at a time", "Une cellule à la fois"),
    }
    patterns = {
        "free": both("The shortest way", "Le plus court chemin"),
        "rows": both("In rows", "Par lignes"),
        "columns": both("In columns", "Par colonnes"),
    }
    return {
        "version": version("grebe"),
        "vessels": [
            {"id": name, "label": both(name), "speed_max_mps": round(vessel.speed_max_mps, 2)}
            for name, vessel in plans.vessels()
        ],
        "patterns": [{"id": name, "label": patterns[name]} for name in PATTERNS],
        "rules": [{"id": name, "label": label} for name, label in rules.items()],
        "quantities": library.quantity_table(BUILTIN, list(BUILTIN)),
        "settings": {
            "cell_m": setting("m", 10.0, 0.5, 1000.0),
            "speed_min_mps": setting("m/s", 0.5, 0.0, 5.0),
            "speed_max_mps": setting("m/s", 1.5, 0.1, 10.0),
            "shore_margin_m": setting("m", 2.0, 0.0, 500.0),
            "rate": setting("x", 20.0, 0.1, 200.0),
        },
        "background": None,
    }


def _preflight(path: Path, link: str) -> list[dict[str, Any]]:
    from grebe.workflow.doctor import diagnose

    marks = {"ok": True, "look": None, "NOT": False}
    found = diagnose(None if link == "simulated" else link, path, datetime.now(UTC))
    return [
        {
            "line": {"en": line.what, "fr": line.what},
            "ok": marks[line.verdict.value],
            "detail": line.found,
            "advice": line.advice,
        }
        for line in found
    ]


def _voyage(given: dict[str, Any]) -> Voyage:
    link = given.get("link", "simulated")
    rate = given.get("rate", 1.0)
    if not isinstance(link, str) or len(link) > 200:
        raise UsageError("The link is no address.", settings=("link",))
    if link.startswith("python:"):
        raise UsageError("A boat of one's own is sailed from the command line.", settings=("link",))
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.1 <= rate <= 200:
        raise UsageError("The rate is a number from 0.1 to 200.", settings=("rate",))
    given_weather = given.get("weather") or {}
    if not isinstance(given_weather, dict):
        raise UsageError("The weather has a current and a wind.", settings=("weather",))
    resume = given.get("resume") is True
    return Voyage(
        link="sim:" if link == "simulated" else link,
        rule=str(given.get("rule", "lookahead")),
        rate=float(rate),
        weather=plans.weather(cast("dict[str, Any]", given_weather)).as_tuple(),
        resume=resume,
        force=given.get("force") is True and not resume,
    )


async def _failed(_: Request, error: Exception) -> Response:
    status = next((code for kind, code in STATUS.items() if isinstance(error, kind)), 400)
    if isinstance(error, _Conflict):
        status = 409
    elif isinstance(error, asked.TooLargeError):
        status = 413
    elif isinstance(error, GrebeError) and status == 400 and not isinstance(error, UsageError):
        status = 422
    body: dict[str, Any] = {
        "code": type(error).__name__.strip("_").removesuffix("Error"),
        "message": str(error),
    }
    if isinstance(error, GrebeError) and error.settings:
        body["setting"] = error.settings[0]
    return JSONResponse({"error": body}, status_code=status)


class _Zipped:
    """Compress answers, but never a stream of events."""

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


async def _missing(_: Request, error: Exception) -> Response:
    status = getattr(error, "status_code", 404)
    message = getattr(error, "detail", "") or "There is nothing here."
    return JSONResponse({"error": {"code": str(status), "message": message}}, status_code=status)


def _routes(app: App) -> list[Route | Mount]:
    one = "/api/surveys/{id}"
    static = Path(str(resources.files("grebe.server"))) / "static"
    return [
        Route("/", _index),
        Route("/api/options", app.options),
        Route("/api/surveys", app.list, methods=["GET"]),
        Route("/api/surveys", app.upload, methods=["POST"]),
        Route("/api/outline", app.outline, methods=["POST"]),
        Route("/api/demo", app.demo, methods=["POST"]),
        Route("/api/plan/preview", app.preview, methods=["POST"]),
        Route("/api/plan", app.keep, methods=["POST"]),
        Route("/api/lease", app.lease, methods=["POST"]),
        Route(one, app.one, methods=["GET", "DELETE"]),
        Route(f"{one}/file", app.file),
        Route(f"{one}/preflight", app.preflight),
        Route(f"{one}/run", app.run, methods=["POST"]),
        Route(f"{one}/events", app.events),
        Route(f"{one}/map", app.grid),
        Route(f"{one}/map/at", app.at),
        Route(f"{one}/map/profile", app.profile),
        Route(f"{one}/map/diff", app.difference),
        Route(f"{one}/replay", app.replay),
        Route(f"{one}/report", app.report, methods=["GET", "POST"]),
        *[
            Route(f"{one}/{command}", app.order, methods=["POST"])
            for command in ("pause", "continue", "return", "stop")
        ],
        Mount("/", StaticFiles(directory=static)),
    ]


def make_app(folder: Path, keys: Keys, hosts: frozenset[str]) -> ASGIApp:
    """The whole server for a folder of surveys; it answers to `hosts` alone."""
    surveys = Library(folder)
    app = App(
        fleet=Fleet(surveys),
        surveys=surveys,
        plan_pool=Worker(),
        map_pool=Worker(),
    )

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None]:
        app.map_pool.begin(maps.warm)
        yield
        for pool in (app.plan_pool, app.map_pool):
            pool.close()

    inner = Starlette(
        routes=_routes(app),
        lifespan=lifespan,
        exception_handlers={GrebeError: _failed, 404: _missing, 405: _missing},
    )
    return Gate(_Zipped(inner), keys, hosts)
