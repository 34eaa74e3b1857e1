"""Read a campaign's file, in TOML, and the survey that it names."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from grebe.campaigns.certificate import Claim
from grebe.campaigns.settings import DEFAULTS, Campaign, Success
from grebe.campaigns.spread import OneOf, Spread, spread_of
from grebe.core.errors import InputError
from grebe.core.revision import survey_of
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.io.store import SurveyFile
from grebe.workflow.steering_names import RULES
from grebe.workflow.vessels import vessel_of

TOP = {"name", "survey", "sortie", "missions", "seed", "success", "claim", "draw"}


@dataclass(frozen=True, kw_only=True)
class Read:
    """A campaign with its survey, and the hash that identifies it."""

    campaign: Campaign
    survey: Survey
    identity: str


def read_campaign(path: Path) -> Read:
    """Read a campaign's file. Raises `InputError` with the reason when something in it is wrong.

    Paths in the file are relative to its folder.
    """
    try:
        written = tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file; describe a campaign in TOML.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}).") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not TOML: {error}.") from None
    _only(path, "", written, TOP)
    if "survey" not in written:
        raise InputError(f"{path} names no survey; add survey = 'FILE.gpkg' with a planned survey.")
    where = path.parent / str(written["survey"])
    with SurveyFile.open(where) as survey_file:
        survey = _sailed(path, where, survey_file, written.get("sortie"))
    campaign = _campaign(path, written)
    identity = campaign.identity(_told(survey))
    return Read(campaign=campaign, survey=survey, identity=identity)


def _sailed(path: Path, where: Path, file: SurveyFile, number: Any) -> Survey:
    """The part of a survey that a mission sails: all of it, or one sortie with its own boat."""
    sorties = file.revision.sorties
    if number is None and len(sorties) < 2:
        return survey_of(file.survey, file.revision, sorties[0] if sorties else None)
    if number is None:
        raise InputError(
            f"{path}: {where.name} is planned in {len(sorties)} sorties, and a mission sails one "
            "of them; choose one, such as sortie = 1."
        )
    if type(number) is not int:
        raise InputError(f"{path}: sortie must be a whole number, not {number!r}.")
    return survey_of(file.survey, file.revision, file.revision.sortie(number))


def _told(survey: Survey) -> str:
    """A hash of all parts of a survey on which a mission depends, and of Grebe's version."""
    shapes = [survey.water, *survey.no_go, *survey.corridors]
    sets = [(one.kind, one.set) for one in survey.targets]
    rest = repr((sets, survey.start, survey.vessel, version("grebe"))).encode()
    return hashlib.sha256(b"".join(one.wkb for one in shapes) + rest).hexdigest()


def _campaign(path: Path, written: Mapping[str, Any]) -> Campaign:
    success = _table(path, written, "success", {"within_minutes", "clearance_m"})
    claim = _table(path, written, "claim", {"confidence", "share"})
    if "within_minutes" not in success:
        raise InputError(f"{path} does not say when a mission is late; add within_minutes = ...")
    for name, value in (*success.items(), *claim.items()):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{path}: {name} must be a number; write it without quotes.")
    for name in ("missions", "seed"):
        if type(written.get(name, 1)) is not int:
            raise InputError(f"{path}: {name} must be a whole number, not {written[name]!r}.")
    drawn = _table(path, written, "draw", set(DEFAULTS))
    spreads = {name: spread_of(name, value) for name, value in drawn.items()}
    for rule in _words(spreads, "rule"):
        if rule not in RULES:
            raise InputError(
                f"{path}: there is no rule {rule!r}; choose one of {', '.join(RULES)}."
            )
    try:
        return Campaign(
            name=str(written.get("name", path.stem)),
            success=Success(
                within_s=60.0 * success["within_minutes"],
                clearance_m=success.get("clearance_m", 0.0),
            ),
            claim=Claim(**claim),
            missions=written.get("missions", 1000),
            seed=written.get("seed", 1),
            spreads=spreads,
            boats=_boats(path, _words(spreads, "boat")),
        )
    except TypeError as error:
        raise InputError(f"{path}: a number is malformed ({error}).") from None


def _words(spreads: Mapping[str, Spread], name: str) -> list[str]:
    spread = spreads.get(name)
    return [str(value) for value in spread.values] if isinstance(spread, OneOf) else []


def _boats(path: Path, names: list[str]) -> dict[str, Vessel]:
    """The vessels of some names: presets, or files in the folder of the campaign's file."""
    beside = {n: str(path.parent / n) if n.endswith(".toml") else n for n in names if n}
    return {name: vessel_of(text) for name, text in beside.items()}


def _table(path: Path, written: Mapping[str, Any], name: str, keys: set[str]) -> dict[str, Any]:
    table = written.get(name, {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: {name} must be a table; write [{name}] above its settings.")
    _only(path, f" of [{name}]", table, keys)
    return table


def _only(path: Path, where: str, written: Mapping[str, Any], known: set[str]) -> None:
    strange = sorted(set(written) - known)
    if strange:
        raise InputError(
            f"{path}: there is no setting {strange[0]!r}{where}; choose from "
            f"{', '.join(sorted(known))}."
        )
