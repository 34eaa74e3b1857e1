"""Read a user's quantities from TOML: one table per quantity, as in `grebe/core/quantities.toml`.

[tryptophan_rfu]
label = { en = "Tryptophan", fr = "Tryptophane" }
unit = "RFU"
cf_unit = "1"
span = [0, 100]
resolution = 0.01
columns = ['trp(rfu)?']

A table with the key of a quantity that Grebe knows changes what it states, and may be empty.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN, Quantities, Quantity, quantities_of
from grebe.io.readers.text import read_text

# A file of this name in a survey's folder is read automatically.
BESIDE_NAME = "quantities.toml"


def read_toml(path: Path) -> dict[str, Any]:
    """Return a file's tables; `InputError` says what is wrong with it."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not TOML: {error}.") from None


def read_quantities(path: Path, base: Mapping[str, Quantity] = BUILTIN) -> Quantities:
    """Return only the quantities that a file holds; `InputError` says what is wrong."""
    return quantities_of(read_toml(path), base, str(path))


def user_quantities(given: Path | None, survey: Path) -> Quantities:
    """Return the quantities of a file that was given or, for None, of the one beside a survey.

    The result is empty if there is neither.
    """
    path = survey.parent / BESIDE_NAME if given is None else given
    if given is None and not path.is_file():
        return Quantities()
    return read_quantities(path)
