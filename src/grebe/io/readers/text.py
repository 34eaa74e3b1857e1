"""Read a text file, with one clear sentence when that fails."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from grebe.core.errors import InputError

# How a UTF-16 file begins as Windows writes it: the byte order mark, little or big endian.
UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


# How an SQLite database begins, and with it a survey file or another GeoPackage.
_SQLITE = b"SQLite format 3\0"
# Control characters that no text holds.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x1f]")


def read_text(path: Path) -> str:
    """Return a file's text, with line endings as in Python.

    It is read from UTF-8, or from UTF-16 with its mark. `InputError` says what is wrong with the
    file.
    """
    data = _read(path)
    try:
        return _checked(path, _decoded(data))
    except UnicodeDecodeError as error:
        raise _undecoded(path, error) from None


def read_any_text(path: Path) -> tuple[str, tuple[str, ...]]:
    """Read as `read_text` does, but also the old code page of Windows, with a note.

    Spreadsheets save files in it.
    """
    data = _read(path)
    try:
        return _checked(path, _decoded(data)), ()
    except UnicodeDecodeError as error:
        try:
            text = data.decode("cp1252")
        except UnicodeDecodeError:
            text = "\0"
        # In UTF-8 with a broken byte, every letter beyond ASCII would become two others.
        rest = data.decode("utf-8", "ignore")
        if _CONTROL.search(text) or not rest.isascii():
            raise _undecoded(path, error) from None
        return _checked(path, text), ("read as Windows-1252 text, because it is not UTF-8",)


def _read(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from None
    _refuse_database(path, data)
    return data


def _decoded(data: bytes) -> str:
    return data.decode("utf-16" if data.startswith(UTF16_MARKS) else "utf-8-sig")


def _refuse_database(path: Path, data: bytes) -> None:
    if data.startswith(_SQLITE):
        raise InputError(
            f"{path}: this is a database, such as a survey file, and no text; a survey is mapped "
            "as it is, and its samples are exported as a table for other programs."
        )


def _undecoded(path: Path, error: UnicodeDecodeError) -> InputError:
    return InputError(
        f"{path}: byte {error.start} is not {error.encoding.upper()} text ({error.reason}); save "
        "the file as UTF-8."
    )


def _checked(path: Path, text: str) -> str:
    if not text.strip():
        raise InputError(f"{path}: the file is empty.")
    if "\0" in text:
        raise InputError(
            f"{path}: character {text.index(chr(0))} is a zero byte: this is not text, or UTF-16 "
            "without its mark; save the file as UTF-8."
        )
    return text.replace("\r\n", "\n").replace("\r", "\n")
