"""Why a map was made as it was, and why another was not, in the report's language.

The library gives its reasons in English. A language has templates of them, `said`, and their
translations, `told`. Values in braces are carried over, with numbers written as in the language. A
reason without a template is left out rather than printed in English.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from grebe.core.quantities import Quantities
from grebe.core.quantity import Quantity
from grebe.report.texts import Texts

_BRACES = re.compile(r"\{(\w+)\}")


def reason_in(text: str, t: Texts) -> str:
    """Translate a reason, part by part between semicolons; empty if no part has a template."""
    if not t["reasons"]:
        return _with_names(text, t)
    found = _whole(text, t)
    if found is not None:
        return found
    parts = [_whole(part, t) for part in text.split("; ")]
    return "\N{NO-BREAK SPACE}; ".join(dict.fromkeys(part for part in parts if part))


def left_out_in(text: str, quantities: Quantities, t: Texts) -> str:
    """Translate why a quantity was not mapped, such as `pH: not measured`."""
    label, colon, why = text.partition(": ")
    one = _by_label(quantities).get(label)
    if not colon or one is None or not t["reasons"]:
        return text
    why = reason_in(why, t)
    return one.label_in(t.language) + (f"{t['colon']}{why}" if why else "")


def _by_label(quantities: Quantities) -> Mapping[str, Quantity]:
    return {one.label: one for one in quantities.values()}


def _whole(text: str, t: Texts) -> str | None:
    """Translate by the first template that fits a reason; None if none fits."""
    for one in t["reasons"]:
        names = _BRACES.findall(one["said"])
        pattern = "([^;]+?)".join(map(re.escape, _BRACES.split(one["said"])[::2]))
        fits = re.fullmatch(pattern, text)
        if fits is not None:
            held = zip(names, fits.groups(), strict=True)
            return one["told"].format(**{name: _told(value, t) for name, value in held})
    return None


def _told(value: str, t: Texts) -> str:
    """Translate a carried-over value: names of covariances, and numbers."""
    numbers = t.number(_with_names(value, t)).replace("%", "\N{NO-BREAK SPACE}%")
    return re.sub(r",(?= )", "\N{NO-BREAK SPACE};", numbers)


def _with_names(text: str, t: Texts) -> str:
    """Call the covariances in a text by their names in the language."""
    kinds: Mapping[str, str] = t["kinds"]
    longest_first = sorted(kinds, key=len, reverse=True)
    names = re.compile(rf"\b({'|'.join(map(re.escape, longest_first))})\b")
    return names.sub(lambda found: kinds[found[0]], text)
