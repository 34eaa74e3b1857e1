"""The surveys of one folder, by ids that do not reveal paths."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.core.errors import GrebeError, InputError
from grebe.core.events import EndReason
from grebe.io.store import SurveyFile
from grebe.server.mission_delta import ENDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SUFFIX = ".gpkg"
END_CODES = {reason.value: ENDS.get(reason, "interrupted") for reason in EndReason}


class UnknownSurveyError(GrebeError):
    """There is no survey of that id."""


@dataclass
class Library:
    """The survey files of a folder."""

    folder: Path
    _known: dict[str, tuple[tuple[float, float], dict[str, Any]]] = field(
        default_factory=dict[str, Any]
    )

    def paths(self) -> dict[str, Path]:
        """The survey files by their ids."""
        return {identity(path): path for path in sorted(self.folder.glob(f"*{SUFFIX}"))}

    def path(self, survey_id: str) -> Path:
        """The file of an id; raises `UnknownSurveyError` if there is none."""
        path = self.paths().get(survey_id)
        if path is None:
            raise UnknownSurveyError("There is no such survey; it may have been deleted.")
        return path

    def summaries(self) -> list[dict[str, Any]]:
        """The entries of the list of surveys, newest first, without unreadable files."""
        found: list[dict[str, Any]] = []
        paths = self.paths()
        for survey_id, path in paths.items():
            with suppress(GrebeError, OSError):
                found.append(self.summary(survey_id, path))
        often = Counter(one["name"] for one in found)
        # Surveys of the same name are distinguished by their file names.
        found = [
            {**one, "name": f"{one['name']} ({paths[one['id']].stem})"}
            if often[one["name"]] > 1
            else one
            for one in found
        ]
        return sorted(found, key=lambda one: one["created"], reverse=True)

    def summary(self, survey_id: str, path: Path) -> dict[str, Any]:
        """One entry of the list, read again only if the file has changed."""
        stamp = (_changed(path), _changed(path.with_name(path.name + "-wal")))
        known = self._known.get(survey_id)
        if known is None or known[0] != stamp:
            with SurveyFile.open(path) as file:
                known = (stamp, {"id": survey_id, **summary_of(file)})
            self._known[survey_id] = known
        return dict(known[1])

    def free_path(self, name: str) -> Path:
        """A path for a new survey, named after the letters and digits of `name`."""
        plain = re.sub(r"[^\w-]+", "-", name, flags=re.UNICODE).strip("-_")[:60] or "survey"
        for count in range(1, 10_000):
            path = self.folder / f"{plain}{'' if count == 1 else f'-{count}'}{SUFFIX}"
            if not path.exists():
                return path
        raise InputError(f"There are too many surveys named {name!r}.")

    def remove(self, path: Path) -> None:
        """Delete a survey and the files that belong to it."""
        for suffix in ("", "-wal", "-shm", ".live", ".log"):
            path.with_name(path.name + suffix).unlink(missing_ok=True)
        for suffix in (".html", ".png"):
            path.with_suffix(suffix).unlink(missing_ok=True)


def identity(path: Path) -> str:
    """The id of a survey file."""
    return hashlib.sha256(path.name.encode()).hexdigest()[:16]


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def summary_of(file: SurveyFile) -> dict[str, Any]:
    """A survey's entry in the list, without its id."""
    survey, meta = file.survey, file.meta()
    return {
        "name": meta.get("app_name") or survey.name,
        "created": meta.get("created", ""),
        "state": state_of(file),
        "cells": len(survey.targets),
        "reached": file.progress().reached,
        "samples": file.count("samples"),
        "area_m2": round(survey.water.area, 1),
    }


def state_of(file: SurveyFile) -> str:
    """The state of a survey according to its file, if no mission is under way."""
    if not file.survey.targets:
        return "imported"
    for event in reversed(file.events()):
        if event.code in END_CODES:
            return END_CODES[event.code]
        if event.code == "mission_started":
            return "interrupted"
    return "planned" if file.track_ends() is None else "interrupted"
