"""The table of all requests that the server answers. The routes and their description are both made
from it, so they always agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import msgspec

from grebe.server import responses

Method = Literal["GET", "POST", "DELETE"]
FILE = "application/octet-stream"
JSON = "application/json"
ERRORS = (
    "400 a setting is impossible, 401 no token and no cookie, 403 from another site or to another "
    "host name, 404 not found, 409 not now or not by this page, 413 too large, 415 another type "
    "of body, 422 the content cannot be used."
)


class Query(NamedTuple):
    """A query parameter; `kind` is its type in JSON."""

    name: str
    what: str
    kind: Literal["string", "number"] = "string"
    required: bool = True


@dataclass(frozen=True, kw_only=True)
class Endpoint:
    """One request. `name` is the method of `App` that answers it. `answer` and `body` are each a
    type of `responses`, a media type if not JSON, or None if empty.
    """

    method: Method
    path: str
    name: str
    what: str
    answer: Any = None
    body: Any = None
    query: Sequence[Query] = ()
    status: int = 200


NAME = Query("name", "the name of the uploaded file, with its ending")
QUANTITY = Query("quantity", "the id of a quantity")
ONE = "/api/surveys/{id}"


def _post(path: str, name: str, what: str, body: Any, answer: Any, status: int = 200) -> Endpoint:
    return Endpoint(
        method="POST", path=path, name=name, what=what, body=body, answer=answer, status=status
    )


def _get(path: str, name: str, what: str, answer: Any, *query: Query) -> Endpoint:
    return Endpoint(method="GET", path=path, name=name, what=what, answer=answer, query=query)


ENDPOINTS: tuple[Endpoint, ...] = (
    _get("/api/openapi.json", "description", "This description.", dict[str, Any]),
    _get("/api/options", "options", "The choices, with limits and defaults.", responses.Options),
    _get(
        "/api/surveys", "list", "The surveys of the folder, newest first.", list[responses.Summary]
    ),
    Endpoint(
        method="POST",
        path="/api/surveys",
        name="upload",
        what="Upload a survey file or a table of samples, and store it as a survey.",
        body=FILE,
        answer=responses.Summary,
        query=(NAME,),
        status=201,
    ),
    Endpoint(
        method="POST",
        path="/api/outline",
        name="outline",
        what="Upload a file of outlines, and return its water as GeoJSON.",
        body=FILE,
        answer=responses.Outline,
        query=(
            NAME,
            Query(
                "islands",
                "which polygons within another one are land: named (those called islands, the "
                "default), all or none",
                required=False,
            ),
            Query(
                "crs",
                "the coordinates of a file that does not name its own, such as EPSG:25832",
                required=False,
            ),
        ),
    ),
    _post(
        "/api/demo",
        "demo",
        "Make a new survey of one hectare.",
        responses.Empty,
        responses.Summary,
        201,
    ),
    _post(
        "/api/plan/preview",
        "preview",
        "Plan without storing: cells, route, length, time and energy, or the problems.",
        responses.PlanRequest,
        responses.Preview,
    ),
    _post(
        "/api/plan",
        "keep",
        "Plan a survey and store it.",
        responses.PlanRequest,
        responses.Summary,
        201,
    ),
    _post(
        "/api/lease",
        "lease",
        "Take or release the right to steer.",
        responses.LeaseRequest,
        responses.LeaseShown,
    ),
    _get(
        "/api/background/{zoom}/{x}/{y}",
        "tile",
        "A tile of the user's own map; 204 if it has none there.",
        "image/*",
    ),
    _get(ONE, "one", "The details of a survey.", responses.Detail),
    Endpoint(
        method="DELETE",
        path=ONE,
        name="remove",
        what="Delete the survey; 409 while it is under way.",
        status=204,
    ),
    _get(f"{ONE}/file", "file", "The survey file.", "application/geopackage+sqlite3"),
    _get(
        f"{ONE}/preflight",
        "preflight",
        "The doctor's checks of the survey and a boat.",
        list[responses.PreflightLine],
        Query("link", "a boat's address, such as mavlink:udp:0.0.0.0:14550", required=False),
    ),
    _post(
        f"{ONE}/run",
        "run",
        "Begin a mission, or resume one.",
        responses.RunRequest,
        responses.Status,
        201,
    ),
    *(
        _post(f"{ONE}/{order}", "order", what, responses.Empty, responses.Status)
        for order, what in (
            ("pause", "Hold station."),
            ("continue", "Continue after a pause."),
            ("return", "Return home."),
            ("stop", "Stop the boat; this needs no lease."),
        )
    ),
    _get(
        f"{ONE}/events",
        "events",
        "Server-sent events: snapshot, then delta, map and lease; honours Last-Event-ID.",
        "text/event-stream",
        Query("tab", "the name of the page or script that listens", required=False),
    ),
    _get(
        f"{ONE}/map",
        "grid",
        "A layer of the map on a grid.",
        responses.Grid,
        QUANTITY,
        Query("layer", "mean, sd, probability or quality", required=False),
        Query("threshold", "for the probability", "number", required=False),
        Query("side", "above or below the threshold", required=False),
    ),
    _get(
        f"{ONE}/map/at",
        "at",
        "The value at a place.",
        responses.Value,
        QUANTITY,
        Query("lon", "longitude [deg]", "number"),
        Query("lat", "latitude [deg]", "number"),
    ),
    _get(
        f"{ONE}/map/profile",
        "profile",
        "Values along a line.",
        responses.Line,
        QUANTITY,
        Query("line", "lon,lat;lon,lat and so on [deg]"),
    ),
    _get(
        f"{ONE}/map/diff",
        "difference",
        "This survey minus another one.",
        responses.Grid,
        QUANTITY,
        Query("other", "the id of the other survey"),
    ),
    _get(f"{ONE}/replay", "replay", "A recorded mission as columns.", responses.Replay),
    _post(
        f"{ONE}/report",
        "make_report",
        "Make the report.",
        responses.ReportRequest,
        responses.ReportMade,
        201,
    ),
    _get(f"{ONE}/report", "report", "The report, if it has been made.", "text/html"),
)


def description(version: str) -> dict[str, Any]:
    """The interface as an OpenAPI 3.1 document."""
    types = [one for each in ENDPOINTS for one in (each.body, each.answer)]
    shapes = [one for one in types if one is not None and not isinstance(one, str)]
    found, components = msgspec.json.schema_components(
        [*shapes, responses.Failure], ref_template="#/components/schemas/{name}"
    )
    schemas = dict(zip(map(repr, shapes), found, strict=False))
    paths: dict[str, dict[str, Any]] = {}
    for each in ENDPOINTS:
        paths.setdefault(each.path, {})[each.method.lower()] = _operation(each, schemas, found[-1])
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Grebe",
            "version": version,
            "description": "Plan, watch, steer and read surveys of a lake; served by grebe app.",
        },
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
        "security": [{"token": []}],
    }


def _operation(each: Endpoint, schemas: dict[str, Any], failure: Any) -> dict[str, Any]:
    named = f"{each.name}_{each.path.rpartition('/')[2]}" if each.name == "order" else each.name
    parts = [part[1:-1] for part in each.path.split("/") if part.startswith("{")]
    operation: dict[str, Any] = {
        "operationId": named,
        "summary": each.what,
        "parameters": [
            *({"name": part, "in": "path", "required": True, "schema": {"type": "string"}}
              for part in parts),
            *({"name": one.name, "in": "query", "required": one.required,
               "description": one.what, "schema": {"type": one.kind}} for one in each.query),
            *([{"name": "X-Grebe-Tab", "in": "header", "required": False,
                "description": "the name by which the lease knows you",
                "schema": {"type": "string"}}] if each.method == "POST" else []),
        ],
        "responses": {
            str(each.status): _answer(each.what, each.answer, schemas),
            "4XX": {"description": ERRORS, "content": {JSON: {"schema": failure}}},
        },
    }  # fmt: skip
    if each.body is not None:
        operation["requestBody"] = {"required": True, "content": _content(each.body, schemas)}
    return operation


def _answer(what: str, answer: Any, schemas: dict[str, Any]) -> dict[str, Any]:
    if answer is None:
        return {"description": what}
    return {"description": what, "content": _content(answer, schemas)}


def _content(shape: Any, schemas: dict[str, Any]) -> dict[str, Any]:
    if isinstance(shape, str):
        return {shape: {}}
    return {JSON: {"schema": schemas[repr(shape)]}}
