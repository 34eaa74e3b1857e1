"""grebe doctor: a preflight checklist with advice on each line."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import click

from grebe.cli import options
from grebe.core.errors import IncompleteError
from grebe.links.checks import Check, Verdict
from grebe.workflow.doctor import diagnose

COLOURS = {Verdict.GOOD: "green", Verdict.DOUBTFUL: "yellow", Verdict.BAD: "red"}


@click.command(name="doctor")
@click.argument("link", required=False)
@click.option("--survey", "survey_file", type=options.EXISTING, help="The survey to sail.")
@click.option(
    "--instrument",
    "instruments",
    multiple=True,
    metavar="ADDRESS@PROFILE",
    help="A sonde that is not read through the boat's link; may be repeated.",
)
@options.json_option
def command(
    link: str | None, survey_file: Path | None, instruments: tuple[str, ...], as_json: bool
) -> None:
    """Check this computer, a survey, the boat behind LINK (mavlink:udp:HOST:PORT) and sondes.

    Nothing is armed, moved or written. The exit code is 7 if a line says NOT.
    """
    found: list[Check] = []
    for line in diagnose(link, survey_file, datetime.now(UTC), instruments):
        found.append(line)
        if not as_json:
            _show(line)
    if as_json:
        rows = [
            {"what": c.what, "verdict": c.verdict.value, "found": c.found, "advice": c.advice}
            for c in found
        ]
        click.echo(json.dumps(rows))
    bad = [line.what for line in found if line.verdict is Verdict.BAD]
    if bad:
        raise IncompleteError(f"Not ready: {', '.join(bad)}.")


def _show(line: Check) -> None:
    mark = click.style(f"{line.verdict.value:>4}", fg=COLOURS[line.verdict], bold=True)
    click.echo(f"{mark}  {line.what}: {line.found}")
    if line.advice:
        click.echo(f"        {line.advice}")
