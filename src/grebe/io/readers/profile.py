"""Profiles: what a logger's file holds, if the file does not say it.

A profile is TOML: `names`, the columns in their order for a file without a header, as a header
would spell them, with units; `columns`, the name of the column of `time`, `lat`, `lon` or a
quantity's key; `zone`, that of its clock.

names = ["time", "latitude", "longitude", "Temp °C", "SpCond mS/cm"]
zone = "Europe/Paris"

[columns]
temperature_degc = "Temp °C"
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import tzinfo
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from grebe.core.errors import InputError
from grebe.io.readers.quantities import read_toml
from grebe.io.readers.zones import zone_of

_KEYS = ("names", "columns", "zone", "note")


@dataclass(frozen=True, kw_only=True)
class Profile:
    """The description of a logger's file.

    `names` of the columns of a file without a header, None if it has one; `columns` by key; `zone`
    of its clock, None if it is not known.
    """

    names: tuple[str, ...] | None = None
    columns: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    zone: tzinfo | None = None


def builtin_profiles() -> dict[str, Path]:
    """Return the profiles that come with Grebe, by name."""
    folder = Path(str(resources.files("grebe.io.readers") / "profiles"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def read_profile(given: str) -> Profile:
    """Return a profile of Grebe by name, or that of a file; `InputError` says what is wrong."""
    ours = builtin_profiles()
    path = ours.get(given, Path(given))
    if not path.is_file():
        raise InputError(
            f"There is no profile {given!r}: give a TOML file, or one of {', '.join(ours)}.",
            settings=("profile",),
        )
    table = read_toml(path)
    unknown = sorted(set(table) - set(_KEYS))
    if unknown:
        raise InputError(f"{path}: holds {unknown[0]!r}; it may hold {', '.join(_KEYS)}.")
    names, columns = table.get("names"), table.get("columns", {})
    if names is not None and not _texts(names):
        raise InputError(f"{path}: names must be a list of texts, the columns in their order.")
    if not isinstance(columns, dict) or not _texts(list(cast("dict[str, Any]", columns).values())):
        raise InputError(f"{path}: columns must be a table of texts, the column names by key.")
    zone = table.get("zone")
    return Profile(
        names=None if names is None else tuple(names),
        columns=MappingProxyType(dict(cast("dict[str, str]", columns))),
        zone=None if zone is None else zone_of(str(zone)),
    )


def _texts(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(one, str) for one in cast("list[object]", value)
    )
