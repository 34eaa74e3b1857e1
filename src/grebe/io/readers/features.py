"""The features of a vector file: their names, and the choice of one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.errors import InputError
from grebe.core.frames import frame_at

# Attributes that hold a lake's name, first match wins; compared in lower case.
NAME_KEYS = ("name", "lake", "lake_name", "lakename", "gnis_name", "nom", "title")


def feature_name(attributes: object) -> str:
    """Return the name of a feature by its attributes; empty if none of them is a name."""
    if not isinstance(attributes, Mapping):
        return ""
    lower = {str(key).lower(): value for key, value in attributes.items()}
    found = (lower.get(key) for key in NAME_KEYS)
    return next((text.strip() for text in found if isinstance(text, str) and text.strip()), "")


def feature_text(number: int, area: BaseGeometry, name: str) -> str:
    """Return the number, name, size and place of a feature, for whoever has to choose."""
    x0, y0, x1, y1 = area.bounds
    where = f"at {(y0 + y1) / 2:.4f} N {(x0 + x1) / 2:.4f} E"
    return f"{number} {name or 'without a name'} ({_size(area)}{where})"


def _size(area: BaseGeometry) -> str:
    """Return the area, if the coordinates allow it."""
    x0, y0, x1, y1 = area.bounds
    if not (-180 <= x0 <= x1 <= 180 and -85 <= y0 <= y1 <= 85):
        return ""
    frame = frame_at(shapely.box(*area.bounds))
    return f"{frame.geometry_to_local(area).area / 1e4:.3g} ha, "


def chosen(path: Path, names: Sequence[str], wanted: str, listed: Sequence[str]) -> int:
    """Return the index of the feature given by a name, ignoring case, or by a number from 1."""
    same = [i for i, name in enumerate(names) if name.lower() == wanted.strip().lower()]
    if len(same) == 1:
        return same[0]
    if not same and wanted.strip().isdecimal() and 1 <= int(wanted) <= len(names):
        return int(wanted) - 1
    what = f"{len(same)} features are called" if same else "no feature is called"
    raise InputError(
        f"{path}: {what} {wanted!r}; choose one by its "
        f"{'number' if same else 'name or number'}: {'; '.join(listed)}.",
        settings=("feature",),
    )
