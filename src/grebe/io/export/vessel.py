"""Write a vessel as TOML, with the known accuracy of its parameters as comments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from grebe.core.errors import InputError
from grebe.core.vessel import Vessel
from grebe.io.atomic_write import write_text_whole


def write_vessel(
    vessel: Vessel,
    path: Path,
    *,
    comments: Mapping[str, str] | None = None,
    head: Sequence[str] = (),
    force: bool = False,
) -> None:
    """Write a vessel; `comments` by field are put after their lines, `head` above everything."""
    if path.exists() and not force:
        raise InputError(
            f"{path} exists already; give another name, or replace it by force.",
            settings=("force",),
        )
    write_text_whole(path, vessel_text(vessel, comments or {}, head))


def vessel_text(vessel: Vessel, comments: Mapping[str, str], head: Sequence[str]) -> str:
    """Return the TOML of a vessel."""
    lines = [f"# {line}".rstrip() for line in head]
    for name, value in asdict(vessel).items():
        line = f"{name} = {_quoted(value) if isinstance(value, str) else _number(value)}"
        lines.append(f"{line}  # {comments[name]}" if name in comments else line)
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    plain = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else " " for c in plain) + '"'


def _number(value: float) -> str:
    """Format a number with six digits, which is more than any identification yields."""
    text = f"{value:.6g}"
    return text if any(c in text for c in ".en") else f"{text}.0"
