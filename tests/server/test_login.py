"""Access from another computer: over TLS, with a password, and with slow guessing."""

from __future__ import annotations

import asyncio
import shutil
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest
from click.testing import CliRunner

pytest.importorskip("starlette")
from server.test_server import HOSTS, on_event, run

from grebe.cli.app_command import PASSWORD_VARIABLE, command
from grebe.core.errors import GrebeError
from grebe.server import login
from grebe.server.app import make_app
from grebe.server.security import Keys

WORD = "correct horse battery"
HEADERS = {"host": "127.0.0.1:8737", "content_type": login.FORM_TYPE}


@pytest.fixture
def gate(tmp_path, monkeypatch):
    monkeypatch.setattr(login, "WRONG_S", 0.05)
    return make_app(tmp_path, Keys(tmp_path, 8737, WORD), HOSTS)


def test_the_page_asks_for_the_password_and_the_right_one_opens_it(gate):
    status, said, body = run(on_event(gate, "/", "GET", b"", **HEADERS))
    assert status == 401
    assert b"type=password" in body
    assert "form-action 'self'" in said["content-security-policy"]
    assert "strict-transport-security" in said
    form = f"password={WORD.replace(' ', '+')}".encode()
    status, said, _ = run(on_event(gate, "/login", "POST", form, **HEADERS))
    assert (status, said["location"]) == (303, "/")
    assert "; Secure" in said["set-cookie"]
    cookie = said["set-cookie"].partition(";")[0]
    assert run(on_event(gate, "/api/options", "GET", b"", cookie=cookie, **HEADERS))[0] == 200


@pytest.mark.parametrize(
    "form",
    [
        b"",
        b"password=",
        b"password=wrong",
        b"x" * 100_000,
        b"\xff\xfe",
        b"password=%ff%fe",
        b"&&&==",
    ],
)
def test_nothing_else_opens_it(gate, form):
    status, said, body = run(on_event(gate, "/login", "POST", form, **HEADERS))
    assert status == 403
    assert "set-cookie" not in said
    assert b"not the password" in body


def test_a_form_of_another_site_is_refused(gate):
    form = f"password={WORD}".encode()
    headers = {**HEADERS, "origin": "https://evil.example"}
    assert run(on_event(gate, "/login", "POST", form, **headers))[0] == 403


def test_guesses_wait_for_each_other_and_too_many_are_turned_away(monkeypatch):
    monkeypatch.setattr(login, "WRONG_S", 0.05)

    async def guess():
        password = login.Password(WORD)
        began = time.monotonic()
        found = await asyncio.gather(*(password.opens("guess") for _ in range(30)))
        return found, time.monotonic() - began

    found, took = run(guess())
    assert found.count(False) == login.MOST_WAITING
    assert found.count(None) == 30 - login.MOST_WAITING
    assert took >= login.MOST_WAITING * 0.05


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not here to make a certificate")
    folder = tmp_path_factory.mktemp("tls")
    files = folder / "chain.pem", folder / "key.pem"
    asked = [
        "openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
        "-nodes", "-days", "30", "-subj", "/CN=127.0.0.1", "-addext",
        "subjectAltName=IP:127.0.0.1", "-out", files[0], "-keyout", files[1],
    ]  # fmt: skip
    subprocess.run(asked, check=True, capture_output=True)
    return files


def refusal(*words):
    """The error message with which the command refuses its options."""
    result = CliRunner().invoke(command, [str(word) for word in words])
    assert isinstance(result.exception, GrebeError)
    return str(result.exception)


def test_other_computers_are_not_let_in_without_tls_name_and_password(
    tmp_path, certificate, monkeypatch
):
    chain, key = certificate
    assert "--certificate and --key" in refusal("--host", "0.0.0.0", "--dir", tmp_path)
    tls = ("--host", "0.0.0.0", "--certificate", chain, "--key", key, "--dir", tmp_path)
    assert "the name by which" in refusal(*tls)
    monkeypatch.setenv(PASSWORD_VARIABLE, "short")
    assert "12 characters" in refusal(*tls, "--name", "boat.local")
    wrong = ("--host", "0.0.0.0", "--certificate", key, "--key", chain, "--name", "x")
    assert "not a certificate and its key" in refusal(*wrong)
    assert "other computers" in refusal("--name", "boat.local")


@pytest.mark.slow
def test_it_is_served_over_tls_and_to_its_name_alone(tmp_path, certificate):
    chain, key = certificate
    words = [
        "app", "--no-browser", "--port", "0", "--dir", tmp_path, "--host", "127.0.0.1",
        "--certificate", chain, "--key", key, "--name", "127.0.0.1",
    ]  # fmt: skip
    run_it = [sys.executable, "-c", "from grebe.cli.main import main; main()", *map(str, words)]
    with subprocess.Popen(
        run_it, stdout=subprocess.PIPE, text=True, env={PASSWORD_VARIABLE: WORD}
    ) as app:
        try:
            address = app.stdout.readline().strip()
            assert address.startswith("https://127.0.0.1:")
            base = address.partition("/?")[0]
            trusts = ssl.create_default_context(cafile=chain)
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(f"{base}/api/options", context=trusts)
            assert refused.value.code == 401
            refused.value.close()
            # A client without TLS gets no answer.
            with pytest.raises((urllib.error.URLError, OSError)):
                urllib.request.urlopen(base.replace("https", "http"))
        finally:
            app.terminate()
