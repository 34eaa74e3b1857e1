"""Read a text file, with one clear sentence where that fails."""

from __future__ import annotations

from pathlib import Path

from grebe.core.errors import InputError


def read_text(path: Path) -> str:
    """Return a file's text; `InputError` says what is wrong with the file."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a UTF-8 text file ({error.reason}).") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty.")
    return text
