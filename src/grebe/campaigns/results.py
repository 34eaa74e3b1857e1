"""A campaign's results on disk: a folder of Parquet parts, each written atomically.

A part is a table of summaries, one row per mission. All parts together are one data set, which
pandas, DuckDB, R and others read as such: `pandas.read_parquet(folder / "missions")`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from grebe.campaigns.task import Summary
from grebe.core.errors import InputError
from grebe.io.atomic_write import write_text_whole, written_whole
from grebe.io.parquet import arrow_for

MISSIONS, IDENTITY = "missions", "campaign.json"
# Missions in a part: a killed campaign sails at most these again, and those of its workers.
PART = 20
OWN = [field.name for field in fields(Summary) if field.name != "drawn"]


def _parquet() -> tuple[Any, Any]:
    return arrow_for("A campaign's results")


class Results:
    """The summaries of a campaign, stored in parts; `known` holds all of them by their numbers."""

    def __init__(self, folder: Path, identity: str, *, force: bool = False) -> None:
        """Open a folder, or make it. Raises `InputError` when it holds another campaign, whose
        missions are deleted with `force`.
        """
        _parquet()
        self.folder = folder
        self._parts = folder / MISSIONS
        self._pending: list[Summary] = []
        self.known: dict[int, Summary] = {}
        try:
            self._parts.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} cannot be made a folder: {error.strerror}.") from None
        if self._belongs_to(identity, force=force):
            for part in sorted(self._parts.glob("part-*.parquet")):
                self.known.update((one.number, one) for one in read_part(part))

    def _belongs_to(self, identity: str, *, force: bool) -> bool:
        """Whether the folder holds missions of this campaign; if not, it is prepared for them."""
        note = self.folder / IDENTITY
        if note.exists():
            if json.loads(note.read_text(encoding="utf-8")).get("identity") == identity:
                return True
            if not force:
                raise InputError(
                    f"{self.folder} holds missions of another campaign, or of this one before it "
                    "was changed; give another folder, or start again by force.",
                    settings=("force",),
                )
        for part in self._parts.glob("part-*.parquet"):
            part.unlink()
        write_text_whole(note, json.dumps({"identity": identity}))
        return False

    def keep(self, summary: Summary) -> None:
        """Store one summary; it is written with its part, at the latest by `flush`."""
        self.known[summary.number] = summary
        self._pending.append(summary)
        if len(self._pending) >= PART:
            self.flush()

    def flush(self) -> None:
        """Write the summaries that are not on disk yet."""
        if not self._pending:
            return
        self._pending.sort(key=lambda one: one.number)
        write_part(self._parts / f"part-{self._pending[0].number:07d}.parquet", self._pending)
        self._pending.clear()


def write_part(path: Path, summaries: Iterable[Summary]) -> None:
    """Write summaries to one Parquet file, completely or not at all."""
    arrow, parquet = _parquet()
    table = arrow.Table.from_pylist([one.row() for one in summaries])
    with written_whole(path) as part:
        parquet.write_table(table, part)


def read_part(path: Path) -> list[Summary]:
    """Return the summaries of a Parquet file. Raises `InputError` when it is not a part."""
    arrow, parquet = _parquet()
    try:
        rows: list[Mapping[str, Any]] = parquet.read_table(path).to_pylist()
        return [_summary(row) for row in rows]
    except (arrow.ArrowInvalid, OSError, KeyError) as error:
        raise InputError(
            f"{path} cannot be read as part of a campaign's results ({error}); remove it, and "
            "its missions are simulated again."
        ) from None


def _summary(row: Mapping[str, Any]) -> Summary:
    drawn = {name: value for name, value in row.items() if name not in OWN}
    return Summary(**{name: row[name] for name in OWN}, drawn=drawn)
