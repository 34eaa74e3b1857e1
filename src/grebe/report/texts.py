"""The report's words in the languages that it is written in."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources
from typing import Any

LANGUAGES = ("en", "fr")


@dataclass(frozen=True)
class Texts:
    """One language: `texts["key"]`, or `texts("key", name=value)` with what is to be filled in."""

    table: dict[str, Any]
    language: str

    def __getitem__(self, key: str) -> Any:
        return self.table[key]

    def __call__(self, key: str, **values: object) -> str:
        """The text of a key with its braces filled in."""
        return str(self.table[key]).format(**values)


def texts_of(language: str) -> Texts:
    """Read the words of one of `LANGUAGES`."""
    file = resources.files("grebe.report") / "texts" / f"{language}.toml"
    return Texts(tomllib.loads(file.read_text("utf-8")), language)
