"""Error responses: one sentence, and the HTTP status that fits it."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from grebe.core.errors import GrebeError, InputError, LinkError, UsageError
from grebe.server import requests
from grebe.server.library import UnknownSurveyError


class NoMapError(InputError):
    """There is no such map, or no water at that place."""


class ConflictError(GrebeError):
    """The request is not allowed now, or not from this page."""


STATUS = {
    UnknownSurveyError: 404,
    NoMapError: 404,
    LinkError: 409,
    ConflictError: 409,
    requests.TooLargeError: 413,
}


async def failed(_: Request, error: Exception) -> Response:
    """The response that says what was wrong with a request."""
    status = next((code for kind, code in STATUS.items() if isinstance(error, kind)), 400)
    if isinstance(error, GrebeError) and status == 400 and not isinstance(error, UsageError):
        status = 422
    body: dict[str, Any] = {
        "code": type(error).__name__.removesuffix("Error"),
        "message": str(error),
    }
    if isinstance(error, GrebeError) and error.settings:
        body["setting"] = error.settings[0]
    return JSONResponse({"error": body}, status_code=status)


async def missing(_: Request, error: Exception) -> Response:
    """The response for an address or a method that does not exist."""
    status = getattr(error, "status_code", 404)
    message = getattr(error, "detail", "") or "There is nothing at this address."
    return JSONResponse({"error": {"code": str(status), "message": message}}, status_code=status)
