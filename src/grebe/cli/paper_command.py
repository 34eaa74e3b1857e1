"""grebe paper: reproduce the paper's figures, each beside the numbers that it must show."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from grebe.cli import files, options, output
from grebe.errors import IncompleteError

NAMES = ("fig1", "fig2", "fig7", "fig8", "fig9")


@click.command(name="paper")
@click.argument("figures", nargs=-1, type=click.Choice(NAMES))
@click.option(
    "--out",
    type=options.FOLDER,
    default=Path("paper"),
    show_default=True,
    help="Folder for the pictures.",
)
@options.json_option
def command(figures: tuple[str, ...], out: Path, as_json: bool) -> None:
    """Reproduce FIGURES of the paper (all of them by default): fly, draw, and check.

    The paper prints no coordinates of its sets and its region; ours are stand-ins.
    """
    from grebe.paper.reproduce import FIGURES

    files.make_folder(out)
    output.note_compilation()
    made = []
    for name in figures or NAMES:
        reproduction = FIGURES[name](out)
        made.append(reproduction)
        if not as_json:
            click.echo(f"{name}: {reproduction.picture}")
            for check in reproduction.checks:
                mark = "ok" if check.holds else "NOT"
                click.echo(f"  {mark:>3}  {check.what}: {check.found}")
    if as_json:
        click.echo(json.dumps([asdict(one) for one in made], default=str))
    missed = [one.figure for one in made if not one.holds]
    if missed:
        raise IncompleteError(f"{', '.join(missed)}: not all that must show does.")
