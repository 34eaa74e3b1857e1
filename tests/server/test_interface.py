"""The description of the interface contains every request, and every answer matches it."""

from __future__ import annotations

import json
import shutil

import jsonschema
import pytest

starlette = pytest.importorskip("starlette")
from server.test_server import HOSTS, REGION, on_event, run  # noqa: E402

from grebe.io.store import SurveyFile  # noqa: E402
from grebe.server import library, plans  # noqa: E402
from grebe.server.app import App, make_app  # noqa: E402
from grebe.server.endpoints import ENDPOINTS, description  # noqa: E402
from grebe.server.security import Keys  # noqa: E402

DESCRIBED = description("0")


def schema_of(path, method, status):
    """The schema of an answer, with the schemas that it refers to."""
    answer = DESCRIBED["paths"][path][method.lower()]["responses"]
    found = answer[status if status in answer else "4XX"]["content"]["application/json"]["schema"]
    return {**found, "components": DESCRIBED["components"]}


@pytest.fixture(scope="module")
def sailed(tmp_path_factory, simulated_survey):
    """A server with a planned survey and a sailed one, as a function of path, method and body."""
    folder = tmp_path_factory.mktemp("served")
    plans.keep_demo(str(folder / "demo.gpkg"))
    shutil.copy(simulated_survey[0], folder / "sailed.gpkg")
    keys = Keys(folder, 8737)
    app = make_app(folder, keys, HOSTS)

    def asked(path, method="GET", body=None):
        headers = {
            "host": "127.0.0.1:8737", "authorization": f"Bearer {keys.bearer}",
            "content_type": "application/json",
        }  # fmt: skip
        sent = b"" if body is None else json.dumps(body).encode()
        status, _, answer = run(on_event(app, path, method, sent, **headers))
        return status, answer

    return asked, library.identity(folder / "demo.gpkg"), library.identity(folder / "sailed.gpkg")


def test_the_document_is_one_of_openapi_and_its_parts_are_there():
    assert DESCRIBED["openapi"].startswith("3.1")
    text = json.dumps(DESCRIBED)
    named = {part.split('"')[0] for part in text.split('"#/components/schemas/')[1:]}
    assert named <= DESCRIBED["components"]["schemas"].keys()
    for schema in DESCRIBED["components"]["schemas"].values():
        jsonschema.Draft202012Validator.check_schema(schema)


def test_every_request_is_answered_by_a_method_and_every_such_method_is_described():
    named = {each.name for each in ENDPOINTS}
    methods = {name for name in vars(App) if not name.startswith("_")}
    assert named == methods - {"plan", "map"} - set(App.__dataclass_fields__)
    asked = [(each.method, each.path) for each in ENDPOINTS]
    assert len(set(asked)) == len(asked)


WISHES = {"region": REGION, "settings": {"cell_m": 20.0}, "name": "x"}
ASKED = [
    ("/api/openapi.json", "GET", None, ""),
    ("/api/options", "GET", None, ""),
    ("/api/surveys", "GET", None, ""),
    ("/api/demo", "POST", {}, ""),
    ("/api/plan/preview", "POST", WISHES, ""),
    ("/api/plan/preview", "POST", {"region": REGION, "settings": {"cell_m": -1}}, ""),
    ("/api/plan/preview", "POST", {"region": 3}, ""),
    ("/api/plan", "POST", WISHES, ""),
    ("/api/plan", "POST", {"region": None, "settings": {}}, ""),
    ("/api/lease", "POST", {"take": True}, ""),
    ("/api/surveys/{id}", "GET", None, ""),
    ("/api/surveys/{id}/preflight", "GET", None, ""),
    ("/api/surveys/{id}/run", "POST", {"rate": -1}, ""),
    ("/api/surveys/{id}/pause", "POST", {}, ""),
    ("/api/surveys/{id}/map", "GET", None, "?quantity=temperature"),
    ("/api/surveys/{id}/map", "GET", None, "?quantity=temperature&layer=sd"),
    ("/api/surveys/{id}/map", "GET", None, "?quantity=nothing"),
    ("/api/surveys/{id}/map/at", "GET", None, "?quantity=temperature&{place}"),
    ("/api/surveys/{id}/map/at", "GET", None, "?quantity=temperature&lon=0&lat=0"),
    ("/api/surveys/{id}/map/profile", "GET", None, "?quantity=temperature&{line}"),
    ("/api/surveys/{id}/replay", "GET", None, ""),
    ("/api/surveys/{id}/report", "POST", {"language": "xx"}, ""),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("path", "method", "body", "query"), ASKED)
def test_every_answer_is_as_it_is_described(sailed, simulated_survey, path, method, body, query):
    asked, _, survey = sailed
    with SurveyFile.open(simulated_survey[0]) as file:
        (lon, lat), (east, north) = file.survey.frame.to_wgs84(file.samples().positions[[0, -1]])
    query = query.replace("{place}", f"lon={lon}&lat={lat}")
    query = query.replace("{line}", f"line={lon},{lat};{east},{north}")
    status, answer = asked(path.replace("{id}", survey) + query, method, body)
    schema = schema_of(path, method, str(status))
    jsonschema.validate(json.loads(answer), schema, cls=jsonschema.Draft202012Validator)
