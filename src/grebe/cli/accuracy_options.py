"""Options of `grebe plan --goal accuracy`, and the plan that they make."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from grebe.cli import options, output
from grebe.core.errors import UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import Vessel
from grebe.planning.region import Region
from grebe.workflow.plans import read_zones

if TYPE_CHECKING:
    from grebe.workflow.accuracy import AccuratePlan


accuracy_options = options.together(
    click.option(
        "--goal",
        type=click.Choice(("time", "accuracy")),
        default="time",
        show_default=True,
        help="time: visit the given cells in the shortest time. accuracy: choose pattern and cells "
        "for the most accurate map within --minutes or --wh, or for --sd in the shortest time.",
    ),
    click.option(
        "--sd",
        "sd_share",
        type=click.FloatRange(0, 1, min_open=True, max_open=True),
        help="With --goal accuracy: the map's standard deviation to reach, as a share of the "
        "quantity's own.",
    ),
    click.option(
        "--like",
        type=options.EXISTING,
        help="With --goal accuracy: take the variation of the water from this earlier survey, "
        "instead of --range.",
    ),
    click.option(
        "--quantity",
        help="With --like: the quantity whose variation counts.  [default: the finest]",
    ),
)


def refuse_without_goal(asked: dict[str, Any]) -> None:
    """Raise `UsageError` for options that require --goal accuracy."""
    for name, flag in (("sd_share", "--sd"), ("like", "--like"), ("quantity", "--quantity")):
        if asked[name] is not None and asked["goal"] != "accuracy":
            raise UsageError(f"{flag} requires --goal accuracy.")


def refuse_with_goal(asked: dict[str, Any], vessels: int) -> None:
    """Raise `UsageError` for options that a plan for accuracy, which is one mission of one boat,
    would ignore.
    """
    if asked["goal"] != "accuracy":
        return
    given = {
        "--battery": bool(asked["sortie_battery_wh"]),
        "--sortie-minutes": bool(asked["sortie_minutes"]),
        "--harbour": bool(asked["harbours"]),
        "--boats": asked["boats"] > 1,
        "a second --vessel": vessels > 1,
        "--pattern": asked["pattern"] != PlanSettings.pattern,
        "--core": asked["core"] != PlanSettings.core,
    }
    for flag, is_given in given.items():
        if is_given:
            raise UsageError(
                f"--goal accuracy plans one mission of one boat and chooses pattern and cells; "
                f"leave out {flag}."
            )


def cell_of(asked: dict[str, Any]) -> float | None:
    """The cell size of a plan for accuracy [m]: None with a budget, else the default, since --sd
    determines the size.
    """
    if asked["cell_m"] is not None:
        raise UsageError(
            "--goal accuracy chooses the cells' size and --cell sets it; give only one of them."
        )
    if (asked["range_m"] is None) == (asked["like"] is None):
        raise UsageError(
            "--goal accuracy needs to know how the water varies: give --range or --like."
        )
    budgeted = asked["minutes"] is not None or asked["energy_wh"] is not None
    if budgeted == (asked["sd_share"] is not None):
        raise UsageError("--goal accuracy needs --minutes or --wh, or else --sd.")
    return None if budgeted else PlanSettings.cell_m


def plan_surest(
    asked: dict[str, Any],
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start: tuple[float, float] | None,
    no_go: tuple[Path, ...],
    *,
    quiet: bool,
) -> AccuratePlan:
    """Plan for the most accurate map, with a progress bar."""
    # Other plans do not need the mapping half of the package, which takes long to import.
    from grebe.workflow.accuracy import CHOICES, plan_for_accuracy, prior_of_range, prior_of_survey

    like: Path | None = asked["like"]
    prior = (
        prior_of_range(asked["range_m"])
        if like is None
        else prior_of_survey(like, asked["quantity"])
    )
    zones, notes = read_zones(no_go, region, crs=asked["crs"])
    for text in notes:
        output.note(f"note: {text}")
    with output.Countdown("plans", CHOICES, quiet=quiet) as bar:
        return plan_for_accuracy(
            region,
            vessel,
            settings,
            prior,
            sd_share=asked["sd_share"],
            start_lonlat=start,
            no_go=zones,
            on_done=bar.update,
        )


def accuracy_numbers(chosen: AccuratePlan, picture: Path) -> dict[str, Any]:
    """The numbers that a plan for accuracy prints besides those of every plan."""
    return {
        "expected_sd": round(chosen.best.share, 4),
        "chosen": chosen.best.said,
        "tried": [
            f"{one.said}: {one.share:.1%} in {one.planned.outcome.time_s / 60:.1f} min"
            for one in chosen.tried
        ],
        "expected_picture": str(picture),
    }
