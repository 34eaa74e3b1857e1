"""Read who made a survey, and on what terms, from TOML.

creator_name = "Jane Doe"
creator_email = "jane@lake.example"
institution = "Lake Institute"
license = "CC-BY-4.0"
publisher_name = "Lake Institute"

All keys are optional. They are those of ACDD, the Attribute Convention for Data Discovery 1.3.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from grebe.core.errors import InputError
from grebe.io.readers.quantities import read_toml


class Credits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who made a survey and on what terms, in the terms of ACDD; empty entries are omitted."""

    creator_name: str = ""
    creator_email: str = ""
    creator_url: str = ""
    creator_type: str = ""
    institution: str = ""
    project: str = ""
    program: str = ""
    acknowledgement: str = ""
    contributor_name: str = ""
    contributor_role: str = ""
    publisher_name: str = ""
    publisher_email: str = ""
    publisher_url: str = ""
    license: str = ""
    naming_authority: str = ""
    references: str = ""
    keywords: str = ""
    summary: str = ""
    title: str = ""
    platform: str = ""
    instrument: str = ""

    def said(self) -> dict[str, str]:
        """Return the entries that are not empty."""
        return {name: value for name, value in msgspec.structs.asdict(self).items() if value}


def read_credits(path: Path | None) -> Credits:
    """Return the credits of a file, or empty ones; `InputError` says what is wrong with it."""
    if path is None:
        return Credits()
    try:
        return msgspec.convert(read_toml(path), Credits)
    except msgspec.ValidationError as error:
        raise InputError(
            f"{path}: {error}; credits may hold {', '.join(Credits.__struct_fields__)}, all texts.",
            settings=("credits_file",),
        ) from None
