"""The preflight checklist: what must hold before a survey, with advice on each item."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Generator, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from grebe.core import kernels
from grebe.core.errors import GrebeError
from grebe.core.plausible import doubts_about
from grebe.core.survey import Survey, is_simulated
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.checks import Check, Verdict, check
from grebe.workflow.boats import MAVLINK_SCHEME, mavlink_address, open_mavlink
from grebe.workflow.instruments import checks_of

# Ample room for a survey: an hour of a mission writes some 9 MB at 10 Hz, with all its tables.
ROOM_BYTES = 500e6
# A clock that shows a time before this was never set.
RELEASED = datetime(2026, 1, 1, tzinfo=UTC)
EXTRAS = {"pymavlink": "mavlink", "serial": "mavlink", "pymodbus": "instruments"}


def diagnose(
    link: str | None, survey_file: Path | None, now: datetime, instruments: Sequence[str] = ()
) -> Iterator[Check]:
    """Yield the items of the list.

    They concern this computer, the survey, the boat behind a link, and the instruments apart from
    it (`ADDRESS@PROFILE` each).
    """
    yield from _computer(survey_file.parent if survey_file else Path(), now)
    survey: Survey | None = None
    if survey_file is not None:
        try:
            survey = yield from _survey(survey_file)
        except GrebeError as error:
            yield check("survey", str(error), holds=False, advice="plan it with grebe plan")
    if link is not None:
        yield from _boat(link, survey)
    for one in instruments:
        yield checks_of(one)


def _computer(folder: Path, now: datetime) -> Iterator[Check]:
    yield check(
        "clock", f"{now:%Y-%m-%d %H:%M:%S} UTC", holds=now >= RELEASED,
        advice="set the clock (NTP, or a receiver): every sample carries its time",
    )  # fmt: skip
    free = shutil.disk_usage(folder).free
    yield check(
        "disk", f"{free / 1e9:.1f} GB free", holds=free > ROOM_BYTES,
        advice=f"make room: at least {ROOM_BYTES / 1e9:g} GB",
    )  # fmt: skip
    yield check(
        "controller", "compiled" if kernels.is_compiled() else "not compiled yet",
        holds=kernels.is_compiled(), otherwise=Verdict.DOUBTFUL,
        advice="run grebe demo once, or the first mission spends a minute compiling",
    )  # fmt: skip
    for module, extra in EXTRAS.items():
        there = importlib.util.find_spec(module) is not None
        yield check(
            f"package {module}", "installed" if there else "missing", holds=there,
            advice=f"pip install 'grebe[{extra}]'", otherwise=Verdict.DOUBTFUL,
        )  # fmt: skip


def _survey(path: Path) -> Generator[Check, None, Survey]:
    with SurveyFile.open(path) as file:
        survey, progress = file.survey, file.progress()
        file.claim()
        rehearsed = file.count("samples") > 0 and is_simulated(file.meta().get("water", ""))
    yield check(
        "survey", f"{len(survey.targets)} targets, {progress.reached} reached",
        holds=len(survey.targets) > progress.reached,
        advice="every target is reached: plan another survey, or start this one again by force",
    )  # fmt: skip
    name = "none" if survey.vessel is None else survey.vessel.name
    yield check(
        "vessel", name, holds=survey.vessel is not None,
        advice="plan the survey again, and name the vessel",
    )  # fmt: skip
    yield check(
        "readings", "simulated" if rehearsed else "none that are simulated", holds=not rehearsed,
        otherwise=Verdict.DOUBTFUL,
        advice="a real boat does not add to them: start the survey again by force, or plan another",
    )  # fmt: skip
    if survey.vessel is not None and (doubts := doubts_about(survey.vessel)):
        yield check(
            "vessel", doubts[0], holds=False, otherwise=Verdict.DOUBTFUL,
            advice="correct the numbers of its file and plan again",
        )  # fmt: skip
    return survey


def _boat(link: str, survey: Survey | None) -> Iterator[Check]:
    scheme, _, rest = link.partition(":")
    if scheme != MAVLINK_SCHEME:
        yield check(
            "link", link, holds=False, otherwise=Verdict.DOUBTFUL,
            advice="only a mavlink: link can be checked beforehand; this one is not",
        )  # fmt: skip
        return
    from grebe.links.mavlink.preflight import preflight

    hull = survey.vessel if survey is not None and survey.vessel else PRESETS["blueboat"]
    frame = None if survey is None else survey.frame
    try:
        opened = open_mavlink(*mavlink_address(rest), frame, hull)
    except GrebeError as error:
        yield check("link", str(error), holds=False, advice="see docs/how-to/your-boat.md")
        return
    try:
        yield from preflight(opened, survey)
    finally:
        opened.close()
