"""An app that was opened for one mission ends by itself, a while after the last page was left."""

from __future__ import annotations

import time

from starlette.types import ASGIApp, Receive, Scope, Send


class Idle:
    """Stands before an app and knows since when nobody has asked it anything."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._open = 0
        self._left = time.monotonic()

    def minutes(self) -> float:
        """For how long there has been no page; a stream that is open is one."""
        return 0.0 if self._open else (time.monotonic() - self._left) / 60.0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        asks = scope["type"] == "http"
        self._open += asks
        try:
            await self._app(scope, receive, send)
        finally:
            self._open -= asks
            self._left = time.monotonic()
