"""Read a text file, with one clear sentence where that fails."""

from __future__ import annotations

import codecs
from pathlib import Path

from grebe.core.errors import InputError

# How a UTF-16 file begins, as Windows writes it: the byte order mark, little or big endian.
UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_text(path: Path) -> str:
    """Return a file's text, of UTF-8 or of UTF-16 with its mark, lines ending as in Python;
    `InputError` says what is wrong with the file.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-16" if data.startswith(UTF16_MARKS) else "utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: byte {error.start} is no {error.encoding.upper()} text ({error.reason}); "
            "save the file as UTF-8."
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty.")
    if "\0" in text:
        raise InputError(
            f"{path}: character {text.index(chr(0))} is a zero byte: this is not text, or UTF-16 "
            "without its mark; save the file as UTF-8."
        )
    return text.replace("\r\n", "\n").replace("\r", "\n")
