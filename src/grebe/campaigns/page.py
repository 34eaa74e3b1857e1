"""The certificate of a campaign, in words and numbers, and a page that presents it."""

from __future__ import annotations

import base64
import json
import math
from collections import Counter
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment

from grebe.campaigns.certificate import Verdict
from grebe.campaigns.drawing import campaign_figure
from grebe.campaigns.run import Outcome
from grebe.campaigns.spread import Between, Normal, OneOf, Spread
from grebe.io.atomic_write import write_text_whole, written_whole
from grebe.report import canvas

CERTIFICATE, REPORT, PICTURE = "certificate.json", "report.html", "campaign.png"

ASSUMPTIONS = (
    "The missions are simulated. The certificate covers the software in this simulated world, "
    "not a boat on a lake; whether it carries over is for whoever signs to judge.",
    "Each mission's weather and boat are drawn independently from the spreads below, and "
    "current and wind stay constant throughout a mission. The certificate holds for one more "
    "draw from these spreads, not for the worst of them.",
    "The boat's position is that of its centre, checked ten times a second; the hull extends "
    "farther.",
    "The missions that count, and the rule by which the campaign stopped, were fixed "
    "beforehand. A campaign that is repeated with other seeds until the result pleases is not "
    "covered.",
)


def sentence(outcome: Outcome) -> str:
    """Return the certificate in one sentence."""
    wanted, claim = outcome.campaign.success, outcome.campaign.claim
    water = (
        f"stay {wanted.clearance_m:g} m clear of the water's edge"
        if wanted.clearance_m
        else "never leave the water"
    )
    return (
        f"With {100 * claim.confidence:g} % confidence at least "
        f"{_floor(outcome.limit)} % of missions in this weather complete within "
        f"{wanted.within_s / 60:g} minutes and {water}."
    )


def verdict_sentence(outcome: Outcome) -> str:
    """Return the verdict on the claim, and how it was reached, in words."""
    share, missions = outcome.campaign.claim.share, len(outcome.missions)
    if share is None:
        return (
            f"No share was claimed: {missions} missions were simulated. The limit is that of "
            "Clopper and Pearson, and holds if their number was fixed before any result was "
            "seen."
        )
    claimed = f"that at least {100 * share:g} % succeed"
    said = {
        Verdict.CERTIFIED: f"The claim {claimed} is certified, after {missions} missions.",
        Verdict.REFUTED: f"The claim {claimed} is refuted, after {missions} missions.",
        Verdict.OPEN: f"The claim {claimed} is not decided by {missions} missions.",
    }[outcome.verdict]
    return (
        f"{said} Limit and decision come from a confidence sequence, which holds wherever a "
        "campaign stops."
    )


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return the certificate as plain values."""
    claim, campaign, missions = outcome.campaign.claim, outcome.campaign, outcome.missions
    times = [one.duration_s for one in missions if one.in_time]
    clear = [one.clearance_m for one in missions if not one.error]
    return {
        "campaign": campaign.name,
        "certificate": sentence(outcome),
        "verdict": outcome.verdict.value if outcome.is_sequential else "none asked for",
        "missions": len(missions),
        "successes": outcome.successes,
        "lower_limit": outcome.limit,
        "confidence": claim.confidence,
        "method": "confidence sequence" if outcome.is_sequential else "Clopper-Pearson",
        "within_s": campaign.success.within_s,
        "late_or_incomplete": sum(not one.in_time for one in missions),
        "too_near_the_edge": sum(not one.in_water for one in missions),
        "ended": dict(Counter(one.error or one.ended or "never begun" for one in missions)),
        "duration_s_median": float(np.median(times)) if times else None,
        "duration_s_p95": round(float(np.percentile(times, 95)), 1) if times else None,
        "clearance_m_least": min(clear) if clear else None,
        "seed": campaign.seed,
        "survey": outcome.survey.name,
        "boat": outcome.survey.vessel.name if outcome.survey.vessel else None,
        "drawn": spreads_in_words(campaign.spreads),
        "software_version": version("grebe"),
        "failed": [one.number for one in missions if not one.success][:100],
    }


def write_report(outcome: Outcome, folder: Path) -> list[Path]:
    """Write the certificate, the picture and the page; return their paths."""
    files = [folder / CERTIFICATE, folder / PICTURE, folder / REPORT]
    told = numbers(outcome)
    write_text_whole(files[0], json.dumps(told | {"assumptions": ASSUMPTIONS}, indent=1))
    picture = canvas.png_bytes(campaign_figure(outcome))
    with written_whole(files[1]) as part:
        part.write_bytes(picture)
    page = Environment(autoescape=True).from_string(_PAGE)
    text = page.render(
        n=told,
        verdict=verdict_sentence(outcome),
        assumptions=ASSUMPTIONS,
        spreads=spreads_in_words(outcome.campaign.spreads),
        picture=base64.b64encode(picture).decode(),
        failed=[one for one in outcome.missions if not one.success][:20],
        survey=outcome.survey.name,
    )
    write_text_whole(files[2], text)
    return files


def spreads_in_words(spreads: Mapping[str, Spread]) -> dict[str, str]:
    """Return each spread in words."""
    return {name.replace("_", " "): _in_words(spread) for name, spread in spreads.items()}


def _in_words(spread: Spread) -> str:
    match spread:
        case Between(low=low, high=high):
            return f"uniform from {low:g} to {high:g}"
        case Normal(mean=mean, sd=sd, low=low, high=high):
            ends = [f"{end:g}" for end in (low, high) if math.isfinite(end)]
            return f"normal, {mean:g} ± {sd:g}" + (
                f", cut off at {' and '.join(ends)}" * bool(ends)
            )
        case OneOf(values=(one,)):
            return f"{one}"
        case OneOf(values=values):
            return "one of " + ", ".join(map(str, values))
        case _:
            return repr(spread)


def _floor(share: float) -> str:
    """A lower limit in per cent, rounded down."""
    return f"{np.floor(1e3 * share) / 10:.1f}"


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ n.campaign }} - certificate</title>
<style>
  body { font: 16px/1.5 system-ui, Helvetica, Arial, sans-serif; color: #1b2a33;
         max-width: 62rem; margin: 2rem auto 4rem; padding: 0 1.2rem; }
  .lead { font-size: 1.25rem; border-left: 4px solid #0072b2; padding: .3rem 0 .3rem .9rem; }
  table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
  td, th { text-align: left; padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid #d9e0e4; }
  th { font-weight: 600; color: #5b6b75; } img { max-width: 100%; }
</style></head><body>
<h1>{{ n.campaign }}</h1>
<p class="lead">{{ n.certificate }}</p>
<p>{{ verdict }} {{ n.successes }} of {{ n.missions }} missions over {{ survey }} succeeded:
{{ n.late_or_incomplete }} were late or did not reach every target, {{ n.too_near_the_edge }} came
too near to the edge of the water or left it; a mission can do both.</p>
<img alt="The confidence limit by mission, the times and clearances, and where missions failed"
     src="data:image/png;base64,{{ picture }}">
<h2>What is drawn for each mission</h2>
<table>{% for name, text in spreads.items() %}<tr><th>{{ name }}</th><td>{{ text }}</td></tr>
{% endfor %}<tr><th>seed</th><td>{{ n.seed }}</td></tr></table>
<h2>What is assumed</h2>
<ol>{% for one in assumptions %}<li>{{ one }}</li>{% endfor %}</ol>
{% if failed %}<h2>Missions that failed{% if n.missions - n.successes > failed|length %}: the first
{{ failed|length }}{% endif %}</h2>
<table><tr><th>number</th><th>ended</th><th>reached</th><th>time [s]</th><th>clearance [m]</th></tr>
{% for one in failed %}<tr><td>{{ one.number }}</td><td>{{ one.error or one.ended }}</td>
<td>{{ one.reached }} of {{ one.targets }}</td><td>{{ one.duration_s }}</td>
<td>{{ one.clearance_m }}</td></tr>
{% endfor %}</table>{% endif %}
</body></html>
"""
