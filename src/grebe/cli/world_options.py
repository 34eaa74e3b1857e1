"""Options of the simulated world: its weather, its boat's deviations from the model, its water."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from grebe.cli import options
from grebe.links.simulated import EstimateErrors
from grebe.workflow.simulated import SimulatedWorld

world_options = options.together(
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=1,
        show_default=True,
        help="Seed of the simulated water.",
    ),
    click.option(
        "--current",
        type=options.NORTH_EAST,
        default="0,0",
        show_default=True,
        help="True current, towards north and east [m/s]; the controller does not know it.",
    ),
    click.option(
        "--wind",
        type=options.NORTH_EAST,
        default="0,0",
        show_default=True,
        help="True wind force, towards north and east [N]; the controller does not know it.",
    ),
    click.option(
        "--mismatch",
        type=click.FloatRange(0, 1, max_open=True),
        default=0.0,
        show_default=True,
        help="Share by which the simulated boat may differ from the controller's model.",
    ),
    click.option(
        "--noise",
        type=click.FloatRange(min=0),
        default=0.0,
        show_default=True,
        help="Standard deviation of the estimated velocities [m/s].",
    ),
    click.option(
        "--lost",
        type=click.FloatRange(0, 1, max_open=True),
        default=0.0,
        show_default=True,
        help="Share of the state estimates that never arrive.",
    ),
    click.option(
        "--water",
        type=options.EXISTING,
        help="CSV track or survey file; the simulated water is conditioned on its samples.",
    ),
)


def world_of(run: dict[str, Any]) -> SimulatedWorld:
    """The simulated world given by the options."""
    return SimulatedWorld(
        weather=options.weather_of(run["current"], run["wind"]),
        mismatch=run["mismatch"],
        errors=EstimateErrors(velocity_mps=run["noise"], lost_share=run["lost"]),
        water_from=None if run["water"] is None else Path(run["water"]),
        seed=run["seed"],
    )
