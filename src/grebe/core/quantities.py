"""The registry of built-in quantities, read from `quantities.toml` beside this module.

A user's file has the same format. A survey file declares its own quantities.
"""

from __future__ import annotations

import tomllib
from importlib import resources

from grebe.core.quantity import LakeStatistics, Limits, Quantities, Quantity
from grebe.core.quantity_tables import quantities_of, read_limit_table

__all__ = [
    "BUILTIN",
    "LIMNOLOGICAL",
    "LakeStatistics",
    "Limits",
    "Quantities",
    "Quantity",
    "quantities_of",
    "read_limit_table",
]


def _builtin() -> Quantities:
    text = (resources.files("grebe.core") / "quantities.toml").read_text("utf-8")
    return quantities_of(tomllib.loads(text), {}, "the built-in quantities")


BUILTIN: Quantities = _builtin()
# The five quantities of remark 11, the default of every survey.
LIMNOLOGICAL: Quantities = BUILTIN.subset(
    ("temperature_degc", "dissolved_oxygen_mgl", "ph", "conductivity_uscm", "turbidity_ntu")
)
