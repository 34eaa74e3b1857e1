"""The password for other computers: its form, and a limit on guessing."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
from urllib.parse import parse_qs

from starlette.types import Receive

LEAST_LENGTH = 12
FORM_MOST = 2000
# Delay of the answer to a wrong password [s]; guesses are answered one after another. At most so
# many may wait.
WRONG_S = 1.0
MOST_WAITING = 20

FORM_TYPE = "application/x-www-form-urlencoded"
STYLE = (
    "body{font:18px system-ui,sans-serif;max-width:22em;margin:15vh auto;padding:0 1em;"
    "background:#fff;color:#10222c}label{display:block;margin:.4em 0}input,button{font:inherit;"
    "min-height:48px;width:100%;box-sizing:border-box;margin-bottom:1em;padding:0 .6em}"
    "p{color:#a32116}"
)
PAGE = (
    '<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content="width='
    'device-width"><title>Grebe</title><style>{style}</style><main><h1>Grebe</h1>{said}'
    "<form method=post action=/login><label for=password>Password · Mot de passe</label>"
    "<input id=password name=password type=password autocomplete=current-password required "
    "autofocus><button>Open · Ouvrir</button></form></main></html>"
)
WRONG = "<p role=alert>This is not the password. · Mot de passe incorrect.</p>"


class Password:
    """The password of a server. It answers one guess at a time, and wrong ones slowly."""

    def __init__(self, password: str) -> None:
        self._digest = _digest(password)
        self._turn = asyncio.Lock()
        self._waiting = 0

    async def opens(self, guess: str) -> bool | None:
        """Whether the guess is right; None if too many guesses are waiting already."""
        if self._waiting >= MOST_WAITING:
            return None
        self._waiting += 1
        try:
            async with self._turn:
                right = hmac.compare_digest(_digest(guess), self._digest)
                if not right:
                    await asyncio.sleep(WRONG_S)
                return right
        finally:
            self._waiting -= 1


def _digest(password: str) -> bytes:
    return hashlib.sha256(password.encode("utf-8", "surrogatepass")).digest()


def page(*, wrong: bool) -> bytes:
    """The HTML page with the password form."""
    return PAGE.format(style=STYLE, said=WRONG if wrong else "").encode()


async def password_of(receive: Receive) -> str:
    """The password in a submitted form; empty if there is none, or if the form is too large."""
    body = bytearray()
    more = True
    while more:
        message = await receive()
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > FORM_MOST or message["type"] == "http.disconnect":
            return ""
    return parse_qs(body.decode("latin-1"), encoding="utf-8").get("password", [""])[0]
