"""Read a vessel of the user's own from TOML: the fields of `grebe.core.vessel.Vessel` by name."""

from __future__ import annotations

import difflib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from grebe.core.errors import VesselError
from grebe.core.vessel import Vessel
from grebe.io.readers.quantities import read_toml

_TEXTS = ("name", "yaw_coupling", "source")


def read_vessel(path: Path) -> Vessel:
    """Return the vessel of a file; `VesselError` says what is wrong with it."""
    table = read_toml(path)
    known = {one.name: one for one in fields(Vessel)}
    for key, value in table.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)
            raise VesselError(f"{path}: a vessel has no {key!r}; is it {near[0]!r}?")
        text = key in _TEXTS
        if text != isinstance(value, str) or isinstance(value, bool):
            raise VesselError(
                f"{path}: {key} = {value!r}, which is not a {'text' if text else 'number'}."
            )
        if not text and not isinstance(value, int | float):
            raise VesselError(f"{path}: {key} = {value!r}, which is not a number.")
    missing = [name for name, one in known.items() if one.default is MISSING and name not in table]
    if missing:
        raise VesselError(f"{path}: a vessel needs {', '.join(missing)} as well.")
    if table.get("yaw_coupling", "fossen") not in ("fossen", "printed"):
        raise VesselError(f"{path}: yaw_coupling must be 'fossen' or 'printed'.")
    given: dict[str, Any] = {key: _plain(value) for key, value in table.items()}
    try:
        return Vessel(**given)
    except VesselError as error:
        raise VesselError(f"{path}: {error}") from None


def _plain(value: str | float) -> str | float:
    return value if isinstance(value, str) else float(value)
