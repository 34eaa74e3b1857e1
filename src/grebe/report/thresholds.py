"""Thresholds that a map is compared with, from an editable profile; each has a citation."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN, Quantities

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from grebe.mapping.quantity_map import QuantityMap

FIELDS = ("quantity", "value", "sense", "label", "citation")


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """A value of a quantity, in its unit. `sense` is the side of concern; `labels` say in each
    language what is beyond the threshold.
    """

    quantity: str
    value: float
    sense: Literal["above", "below"]
    labels: Mapping[str, str]
    citation: str

    @property
    def name(self) -> str:
        """The concern as a formula, used to name bands and variables."""
        return f"P({self.quantity} {'>' if self.sense == 'above' else '<'} {self.value:g})"

    def label(self, language: str) -> str:
        """The label in a language, or in the first language it is given in."""
        return self.labels.get(language) or next(iter(self.labels.values()))

    def probability(self, one: QuantityMap) -> NDArray[np.floating]:
        """Probability that the signal is on the side of concern, (rows, columns)."""
        above = one.exceedance(self.value)
        return above if self.sense == "above" else 1 - above


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A named set of thresholds."""

    name: str
    thresholds: Sequence[Threshold]

    def of(self, one: QuantityMap) -> list[Threshold]:
        """The thresholds of a map's quantity."""
        return [each for each in self.thresholds if each.quantity == one.quantity.key]


def read_profile(path: Path | None, quantities: Quantities = BUILTIN) -> Profile:
    """Read a profile of thresholds for the given quantities; the package's own by default.

    Raises `InputError`, which says what is wrong.
    """
    name = str(path or "the profile")
    try:
        text = (
            path.read_text(encoding="utf-8")
            if path is not None
            else (resources.files("grebe.report") / "profiles" / "freshwater.toml").read_text(
                "utf-8"
            )
        )
        table = tomllib.loads(text)
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{name} is not TOML: {error}.") from None
    rows = table.get("threshold", [])
    if not isinstance(rows, list):
        raise InputError(f"{name}: thresholds are written as [[threshold]] tables.")
    return Profile(
        name=str(table.get("name", name)),
        thresholds=tuple(_threshold(name, row, quantities) for row in cast("list[Any]", rows)),
    )


def _threshold(name: str, row: Any, quantities: Quantities) -> Threshold:
    if not isinstance(row, dict) or set(cast("dict[str, Any]", row)) != set(FIELDS):
        raise InputError(f"{name}: each [[threshold]] needs {', '.join(FIELDS)}.")
    given = cast("dict[str, Any]", row)
    if given["quantity"] not in quantities:
        raise InputError(
            f"{name}: there is no quantity {given['quantity']!r}; choose one of "
            f"{quantities.keys_text}."
        )
    if given["sense"] not in ("above", "below"):
        raise InputError(f"{name}: sense must be 'above' or 'below', not {given['sense']!r}.")
    try:
        value = float(given["value"])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{name}: the threshold of {given['quantity']} is {given['value']!r}; "
            "give a finite number."
        )
    return Threshold(
        quantity=str(given["quantity"]),
        value=value,
        sense=given["sense"],
        labels=_labels(name, given["label"]),
        citation=str(given["citation"]),
    )


def _labels(name: str, given: object) -> dict[str, str]:
    """Return a label's texts by language, from a text or a table."""
    table = cast("dict[str, Any]", given) if isinstance(given, dict) else {"en": given}
    labels = {language: text for language, text in table.items() if isinstance(text, str) and text}
    if not labels or len(labels) < len(table):
        raise InputError(f"{name}: a label must be a text, or a table such as {{ en = '...' }}.")
    return labels
