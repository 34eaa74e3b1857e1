"""The report's texts, in the languages it can be written in."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from importlib import resources
from typing import Any

LANGUAGES = ("en", "fr")
# A comma between thousands; a decimal point.
_THOUSANDS, _POINT = re.compile(r"(?<=\d),(?=\d{3}\b)"), re.compile(r"(?<=\d)\.(?=\d)")


@dataclass(frozen=True)
class Texts:
    """One language: `texts["key"]`, or `texts("key", name=value)` with its braces filled in."""

    table: dict[str, Any]
    language: str

    def __getitem__(self, key: str) -> Any:
        return self.table[key]

    def __call__(self, key: str, **values: object) -> str:
        """Return the text of a key with its braces filled in."""
        return str(self.table[key]).format(**values)

    def number(self, text: object) -> str:
        """Rewrite the numbers of a text, such as 1,234.5, as the language writes them."""
        if self.language != "fr":
            return str(text)
        grouped = _THOUSANDS.sub("\N{NARROW NO-BREAK SPACE}", str(text))
        return _POINT.sub(",", grouped)

    def share(self, share: float, decimals: int = 0) -> str:
        """A share in per cent."""
        return self.number(f"{100 * share:.{decimals}f}\N{NO-BREAK SPACE}%")


def texts_of(language: str) -> Texts:
    """Read the texts of one of `LANGUAGES`."""
    file = resources.files("grebe.report") / "texts" / f"{language}.toml"
    return Texts(tomllib.loads(file.read_text("utf-8")), language)
