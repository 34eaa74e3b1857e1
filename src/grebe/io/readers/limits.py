"""Read limits for quality control from TOML: one table per quantity; omitted limits are unchanged.

[ph]
suspect_span = [6.0, 9.5]
spike_suspect = 0.2
"""

from __future__ import annotations

from pathlib import Path

from grebe.core.errors import InputError
from grebe.core.quantities import Quantities, read_limit_table
from grebe.io.readers.quantities import read_toml


def read_limits(path: Path, quantities: Quantities) -> Quantities:
    """Return the quantities with a file's limits; `InputError` says what is wrong with it."""
    limits = {}
    for key, table in read_toml(path).items():
        if key not in quantities:
            raise InputError(
                f"{path}: there is no quantity {key!r}; choose one of {quantities.keys_text}."
            )
        if not isinstance(table, dict):
            raise InputError(f"{path}: {key} is not a table; write [{key}] and its limits below.")
        try:
            limits[key] = read_limit_table(table)
        except InputError as error:
            raise InputError(f"{path}: [{key}] {error}") from None
    return quantities.with_limits(limits)
