"""Access control. By default only this computer's user has access, through the page that the server
itself served; from another computer, over TLS, anyone who knows the password.

A page of another site has no access: it lacks the cookie (SameSite), its Origin is refused, and a
name made to point here (DNS rebinding) is not among the known Hosts.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grebe.server import login

HEADERS = {
    "content-security-policy": "default-src 'self'; img-src 'self' data: blob:; "
    "style-src 'self' 'unsafe-inline'; frame-ancestors 'self'; base-uri 'none'; "
    "form-action 'none'; object-src 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
# The login page may send its form to this server only.
LOGIN_POLICY = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; base-uri 'none'"
REMOTE = {"strict-transport-security": "max-age=31536000"}
BODIES = ("application/json", "application/octet-stream")
# The only page shown without a cookie: it says how to open the app.
CLOSED = (
    b"<!doctype html><meta charset=utf-8><title>Grebe</title><p>This page is opened by the "
    b"address that <code>grebe app</code> prints, with its token."
)


class Keys:
    """The secrets of one server: a launch token that works once, a cookie that outlives it, and a
    token for scripts.

    Cookie and script token derive from a secret in the folder of surveys, readable by its owner
    alone, so an open page stays valid when the server is started again.
    """

    def __init__(self, folder: Path, port: int, password: str | None = None) -> None:
        self.password = None if password is None else login.Password(password)
        self.cookie_name = f"grebe_{port}"
        self.cookie = hashlib.sha256(f"{_secret(folder)}:{port}".encode()).hexdigest()
        self.bearer = hashlib.sha256(f"bearer:{_secret(folder)}:{port}".encode()).hexdigest()
        self._launch: str | None = secrets.token_urlsafe(24)
        self.launch_token = self._launch

    def exchange(self, token: str) -> bool:
        """Whether `token` is the launch token, which then becomes invalid."""
        known = self._launch is not None and hmac.compare_digest(
            token.encode(), self._launch.encode()
        )
        if known:
            self._launch = None
        return known

    def new_cookie(self) -> str:
        """The header that sets a browser's cookie; with a password the cookie is for TLS only."""
        secure = "" if self.password is None else "; Secure"
        return f"{self.cookie_name}={self.cookie}; Path=/; HttpOnly; SameSite=Strict{secure}"

    def knows(self, headers: dict[str, str]) -> bool:
        """Whether a request carries the cookie or the token of scripts."""
        given = headers.get("authorization", "")
        if given.startswith("Bearer ") and _same(given[7:], self.bearer):
            return True
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        found = cookies.get(self.cookie_name)
        return found is not None and _same(found.value, self.cookie)


def _same(given: str, known: str) -> bool:
    return hmac.compare_digest(given.encode(), known.encode())


def _secret(folder: Path) -> str:
    """The secret of a folder, created if it does not exist."""
    path = folder / ".grebe-app"
    try:
        text = path.read_text(encoding="ascii").strip()
        if len(text) >= 32:
            return text
    except (OSError, UnicodeDecodeError):
        pass
    path.unlink(missing_ok=True)
    text = secrets.token_urlsafe(32)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(text)
    return text


class Gate:
    """Wraps the app: refuses requests that are not allowed, and adds security headers."""

    def __init__(self, app: ASGIApp, keys: Keys, hosts: frozenset[str]) -> None:
        self._app = app
        self._keys = keys
        self._hosts = hosts
        self._more_headers = HEADERS if keys.password is None else {**HEADERS, **REMOTE}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on to the app, or answer it here."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                there = {name for name, _ in message.get("headers", [])}
                more = [
                    (name.encode(), value.encode())
                    for name, value in self._more_headers.items()
                    if name.encode() not in there
                ]
                message = {**message, "headers": [*message.get("headers", []), *more]}
            await send(message)

        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1")
            for name, value in scope["headers"]
        }
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await _answer(with_headers, *refusal)
        elif scope["path"] == "/login" and self._keys.password is not None:
            await self._login(scope, self._keys.password, receive, with_headers)
        elif scope["path"] == "/":
            await self._page(scope, headers, receive, with_headers)
        else:
            await self._app(scope, receive, with_headers)

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str, str] | None:
        if headers.get("host", "").lower() not in self._hosts:
            return 403, "host", "This server answers only to its own name."
        origin = headers.get("origin")
        foreign = origin is not None and origin.partition("://")[2].lower() not in self._hosts
        crossed = headers.get("sec-fetch-site") == "cross-site" and scope["path"] != "/"
        if foreign or crossed:
            return 403, "origin", "Pages of other sites may not use this server."
        if scope["path"].startswith("/api"):
            return self._api_refusal(scope, headers)
        return None

    def _api_refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str, str] | None:
        if not self._keys.knows(headers):
            message = "Open the page with the address that grebe app prints."
            return 401, "token", message
        kind = headers.get("content-type", "").partition(";")[0].strip().lower()
        if scope["method"] in ("POST", "PUT", "PATCH") and kind not in BODIES:
            return 415, "content_type", "Send application/json or application/octet-stream."
        return None

    async def _page(
        self, scope: Scope, headers: dict[str, str], receive: Receive, send: Send
    ) -> None:
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if token and self._keys.exchange(token):
            await _redirect(send, self._keys.new_cookie())
        elif self._keys.knows(headers):
            await (_redirect(send, None) if token else self._app(scope, receive, send))
        elif self._keys.password is not None:
            await _ask_password(send, 401, wrong=False)
        else:
            await _send(send, 401, CLOSED, [(b"content-type", b"text/html; charset=utf-8")])

    async def _login(
        self, scope: Scope, password: login.Password, receive: Receive, send: Send
    ) -> None:
        """Check a password, and set the cookie if it is right."""
        if scope["method"] != "POST":
            await _redirect(send, None)
            return
        opens = await password.opens(await login.password_of(receive))
        if opens is None:
            await _answer(send, 429, "busy", "Too many passwords are being tried; wait a moment.")
        elif opens:
            await _redirect(send, self._keys.new_cookie())
        else:
            await _ask_password(send, 403, wrong=True)


async def _redirect(send: Send, cookie: str | None) -> None:
    headers = [(b"location", b"/"), (b"cache-control", b"no-store")]
    if cookie:
        headers.append((b"set-cookie", cookie.encode()))
    await _send(send, 303, b"", headers)


async def _ask_password(send: Send, status: int, *, wrong: bool) -> None:
    headers = [
        (b"content-type", b"text/html; charset=utf-8"),
        (b"content-security-policy", LOGIN_POLICY.encode()),
        (b"cache-control", b"no-store"),
    ]
    await _send(send, status, login.page(wrong=wrong), headers)


async def _answer(send: Send, status: int, code: str, message: str) -> None:
    body = json.dumps({"error": {"code": code, "message": message}}).encode()
    await _send(send, status, body, [(b"content-type", b"application/json")])


async def _send(send: Send, status: int, body: bytes, headers: list[tuple[bytes, bytes]]) -> None:
    length = (b"content-length", str(len(body)).encode())
    await send({"type": "http.response.start", "status": status, "headers": [*headers, length]})
    await send({"type": "http.response.body", "body": body})
