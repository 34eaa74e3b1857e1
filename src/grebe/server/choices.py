"""The choices of the app for planning and sailing a survey, and the preflight checks."""

from __future__ import annotations

from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from grebe.core.plan_settings import PATTERNS
from grebe.core.quantities import BUILTIN
from grebe.core.vessel import PRESETS
from grebe.server import views
from grebe.server.background import Background, shown


def options(background: Background | None) -> dict[str, Any]:
    """All choices, with limits and defaults."""

    def setting(unit: str, default: float, low: float, high: float) -> dict[str, Any]:
        return {"unit": unit, "default": default, "min": low, "max": high}

    def both(text: str, french: str | None = None) -> dict[str, str]:
        return {"en": text, "fr": french or text}

    rules = {
        "lookahead": both("Looks ahead over many cells", "Voit plusieurs cellules devant"),
        "dual": both("Two cells at a time (the paper's)", "Deux cellules à la fois (l'article)"),
        "single": both("One cell at a time", "Une cellule à la fois"),
    }
    patterns = {
        "free": both("Shortest route", "Trajet le plus court"),
        "rows": both("In rows", "Par lignes"),
        "columns": both("In columns", "Par colonnes"),
    }
    return {
        "version": version("grebe"),
        "vessels": [
            {"id": name, "label": both(name), "speed_max_mps": round(vessel.speed_max_mps, 2)}
            for name, vessel in sorted(PRESETS.items())
        ],
        "patterns": [{"id": name, "label": patterns[name]} for name in PATTERNS],
        "rules": [{"id": name, "label": label} for name, label in rules.items()],
        "quantities": views.quantity_table(BUILTIN, list(BUILTIN)),
        "settings": {
            "cell_m": setting("m", 10.0, 0.5, 1000.0),
            "speed_min_mps": setting("m/s", 0.5, 0.0, 5.0),
            "speed_max_mps": setting("m/s", 1.5, 0.1, 10.0),
            "shore_margin_m": setting("m", 2.0, 0.0, 500.0),
            "rate": setting("x", 20.0, 0.1, 200.0),
        },
        "background": shown(background),
    }


def preflight(path: Path, link: str) -> list[dict[str, Any]]:
    """The doctor's checks of a survey and a boat."""
    from grebe.workflow.doctor import diagnose

    marks = {"ok": True, "look": None, "NOT": False}
    found = diagnose(None if link == "simulated" else link, path, datetime.now(UTC))
    return [
        {
            "line": {"en": line.what, "fr": line.what},
            "ok": marks[line.verdict.value],
            "detail": line.found,
            "advice": line.advice,
        }
        for line in found
    ]
