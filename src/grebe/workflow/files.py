"""Make the folders and survey files that are written to, the latter with their metadata."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from grebe.core.errors import InputError
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.revision import PlanRevision
from grebe.core.survey import Survey
from grebe.io.store import SurveyFile
from grebe.io.store.plan_tables import settings_text
from grebe.io.store.timestamps import time_text


def write_survey(
    path: Path,
    survey: Survey,
    *,
    quantities: Quantities = LIMNOLOGICAL,
    force: bool = False,
    note: str = "",
    revision: PlanRevision | None = None,
) -> None:
    """Write a survey to a new file, with its identity, origin and configuration.

    The file declares `quantities`; `revision` holds the plan's sorties, if it has any. An existing
    file is replaced only by `force`.
    """
    configuration = settings_text(survey.settings)
    meta = {
        "survey_id": str(uuid.uuid4()),
        "created": time_text(datetime.now(UTC)),
        "software_version": version("grebe"),
        "configuration": configuration,
        "configuration_hash": hashlib.sha256(configuration.encode()).hexdigest(),
        "note": note,
    }
    SurveyFile.write(path, survey, meta=meta, force=force, quantities=quantities, revision=revision)


@contextmanager
def filled_folder(path: Path) -> Generator[Path]:
    """Make a folder for new files; remove it again if it was made and nothing was written."""
    was_there = path.is_dir()
    make_folder(path)
    try:
        yield path
    finally:
        if not was_there:
            # This succeeds only if it is still empty.
            with suppress(OSError):
                path.rmdir()


def make_folder(path: Path) -> None:
    """Make a folder and its parents; `InputError` says why that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be made a folder: {error.strerror}.") from None
