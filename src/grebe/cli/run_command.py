"""grebe run: steer a boat through every target set of a survey."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import click

from grebe.cli import options, output
from grebe.control.settings import (
    RULES,
    SOLVERS,
    ControlSettings,
    RuleName,
    SolverName,
    settings_for,
)
from grebe.dynamics import Weather
from grebe.errors import IncompleteError, LinkError
from grebe.simulated_mission import SimulationSettings, simulate
from grebe.store import SurveyFile

DEFAULTS = ControlSettings()


@click.command(name="run")
@click.argument("file", type=options.EXISTING)
@click.option(
    "--link", default="simulated", show_default=True, help="Which boat: only 'simulated' so far."
)
@click.option(
    "--rule", type=click.Choice(RULES), default=DEFAULTS.rule, show_default=True, help="Who plans."
)
@click.option(
    "--solver",
    type=click.Choice(SOLVERS),
    default=DEFAULTS.solver,
    show_default=True,
    help="Who solves.",
)
@click.option("--horizon", type=int, help="N, in stages [lookahead 32, else 15].")
@click.option("--step", "step_s", type=float, help="T [s] [lookahead 0.5, else 1].")
@click.option(
    "--epsilon",
    type=float,
    default=DEFAULTS.epsilon,
    show_default=True,
    help="For single and dual: from how far off the next set counts (Definition 8).",
)
@click.option("--seed", type=int, default=1, show_default=True, help="Of the simulated water.")
@click.option(
    "--current",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="True current [m/s]; the controller is not told.",
)
@click.option(
    "--wind",
    type=options.NORTH_EAST,
    default="0,0",
    show_default=True,
    help="True wind force [N]; the controller is not told.",
)
@click.option(
    "--water",
    type=options.EXISTING,
    help="CSV track or survey file on whose samples the simulated water is conditioned.",
)
@click.option("--resume", is_flag=True, help="Go on where the recorded mission ends.")
@options.force_option
@options.json_option
@click.pass_context
def command(
    ctx: click.Context,
    file: Path,
    link: str,
    rule: RuleName,
    solver: SolverName,
    horizon: int | None,
    step_s: float | None,
    epsilon: float,
    seed: int,
    current: tuple[float, float],
    wind: tuple[float, float],
    water: Path | None,
    resume: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Steer the boat through every target set of FILE and record what it measures."""
    if link != "simulated":
        raise LinkError(f"There is no boat link {link!r}; 'simulated' is the only one so far.")
    control = settings_for(rule, horizon, step_s, solver=solver, epsilon=epsilon)
    world = SimulationSettings(
        weather=Weather(
            current_north_mps=current[0],
            current_east_mps=current[1],
            wind_force_north_n=wind[0],
            wind_force_east_n=wind[1],
        ),
        water_from=water,
        seed=seed,
    )
    with SurveyFile.open(file) as survey_file, output.MissionBar(quiet=as_json) as bar:
        report = simulate(
            survey_file,
            control,
            world,
            datetime.now(UTC),
            resume=resume,
            force=force,
            watch=bar.update,
        )
    output.result(asdict(report), as_json=as_json, next_command=f"grebe map {file} --out maps")
    if not report.complete:
        raise IncompleteError(
            f"{report.targets - report.reached} of {report.targets} target sets were not reached; "
            f"go on with: grebe run {file} --resume"
        )
