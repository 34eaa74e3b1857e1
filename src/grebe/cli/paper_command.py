"""grebe paper: reproduce the paper's figures and check their numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from grebe.cli import options, output
from grebe.core.errors import IncompleteError, UsageError
from grebe.workflow.files import make_folder

if TYPE_CHECKING:
    from grebe.core.vessel import Vessel
    from grebe.paper.checks import Reproduction
    from grebe.paper.hand_driven import HandDriven

FLOWN = ("fig1", "fig2", "fig7", "fig8", "fig9")
BY_HAND = ("fig4", "fig5", "fig6")
CLAIM = "claim"


@click.command(name="paper")
@click.argument("figures", nargs=-1, type=click.Choice((*FLOWN, *BY_HAND, CLAIM)))
@click.option(
    "--out",
    type=options.FOLDER,
    default=Path("paper"),
    show_default=True,
    help="Folder for the pictures.",
)
@click.option(
    "--track", type=options.EXISTING, help="Hand-driven track (CSV) for fig4, fig5, fig6 and claim."
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=30,
    show_default=True,
    help="Number of simulated waters on which the claim is tested.",
)
@click.option(
    "--printed-sign",
    is_flag=True,
    help="Use the last row of Eq. (9) as printed, instead of Fossen's sign, for Figs. 1, 2 and 7 "
    "to 9.",
)
@click.option(
    "--header-from",
    type=options.EXISTING,
    help="Take the track's column names from the first row of this file.",
)
@options.json_option
def command(
    figures: tuple[str, ...],
    out: Path,
    track: Path | None,
    seeds: int,
    printed_sign: bool,
    header_from: Path | None,
    as_json: bool,
) -> None:
    """Simulate, draw and check FIGURES of the paper (by default all that need no --track).

    The paper gives no coordinates of its sets and its region, and its data are not public; Grebe
    uses stand-ins. `claim` measures whether a planned survey gives a better map than one driven by
    hand.
    """
    wanted = figures or (FLOWN if track is None else (*FLOWN, *BY_HAND))
    if track is None and set(wanted) & {*BY_HAND, CLAIM}:
        raise UsageError(f"{', '.join((*BY_HAND, CLAIM))} need a hand-driven track: --track FILE.")
    from grebe.core.vessel import with_printed_sign
    from grebe.paper.hand_driven import HandDriven
    from grebe.paper.scenes import BOAT

    make_folder(out)
    output.compile_once()
    hand = None if track is None else HandDriven.read(track, header_from)
    boat = with_printed_sign(BOAT) if printed_sign else BOAT
    flown = [name for name in wanted if name != CLAIM]
    made = _reproduced(flown, out, hand, boat, quiet=as_json)
    rows = _claimed(out, hand, seeds, quiet=as_json) if CLAIM in wanted and hand else []
    if as_json:
        shown = [asdict(one) for one in made]
        click.echo(json.dumps([*shown, *([{"figure": CLAIM, "rows": rows}] if rows else [])],
                              default=str))  # fmt: skip
    missed = [one.figure for one in made if not one.holds]
    if missed:
        raise IncompleteError(f"{', '.join(missed)}: not all checks hold.")


def _reproduced(
    names: Sequence[str], out: Path, hand: HandDriven | None, boat: Vessel, *, quiet: bool
) -> list[Reproduction]:
    from grebe.paper.hand_figures import HAND_FIGURES
    from grebe.paper.reproduce import FIGURES

    made: list[Reproduction] = []
    for name in names:
        by_hand = HAND_FIGURES.get(name)
        one = by_hand(out, hand) if by_hand and hand else FIGURES[name](out, boat)
        made.append(one)
        if quiet:
            continue
        click.echo(f"{name}: {one.picture}")
        for check in one.checks:
            mark = "ok" if check.holds else "NOT"
            click.echo(f"  {mark:>3}  {check.what}: {check.found}")
    return made


def _claimed(
    out: Path, hand: HandDriven, seeds: int, *, quiet: bool
) -> list[dict[str, float | str]]:
    from grebe.paper import claim, drawings
    from grebe.report.canvas import save

    sampled = claim.samplings(hand)
    for one in sampled:
        output.note(
            f"{one.method}: {len(one.positions)} samples, {one.length_m:.0f} m, "
            f"{one.duration_s / 60:.1f} min"
        )
    with output.Countdown("waters", seeds, quiet=quiet) as countdown:
        scores = list(claim.measure(hand, sampled, seeds, countdown.update))
    picture = save(drawings.claim(scores), out / "claim.png")
    rows = claim.summary(scores)
    if not quiet:
        click.echo(f"claim: {picture}")
        for row in rows:
            click.echo(
                f"  {row['quantity']:<22}{row['method']:<24} rmse {row['rmse']:.4g}  largest error "
                f"{row['largest']:.4g}  unsure {row['unsure']:.0%}  within 95 % "
                f"{row['coverage95']:.0%}  better in {row['better_share']:.0%} of the waters"
            )
    return rows
