"""grebe lag: estimate sensor lags from two runs along the same line."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from grebe.cli import options, output
from grebe.core.quantity import Quantity
from grebe.mapping.lag import LagEstimate
from grebe.workflow.lags import compare_runs


@click.command(name="lag")
@click.argument("first", type=options.EXISTING)
@click.argument("second", type=options.EXISTING)
@options.json_option
def command(first: Path, second: Path, as_json: bool) -> None:
    """Compare FIRST and SECOND, two runs along the same line at different speeds or directions.

    Prints, for each quantity, the delay and the time constant that bring the runs closest, and
    whether a correction is worthwhile: no lag explains how the water changed between the runs.
    """
    found, quantities = compare_runs(first, second)
    advised = " ".join(
        f"--lag {key}={one.lag.delay_s:g},{one.lag.tau_s:g}"
        for key, one in found.items()
        if one.advised
    )
    output.result(
        {key: _numbers(one) for key, one in found.items()}
        if as_json
        else dict(_row(quantities.known(key), one) for key, one in found.items()),
        as_json=as_json,
        next_command=f"grebe check {output.quoted(first)} {advised}"
        if advised
        else "grebe map: no correction is worth making",
    )


def _numbers(one: LagEstimate) -> dict[str, Any]:
    return asdict(one) | {"gain": one.gain, "advised": one.advised}


def _row(quantity: Quantity, one: LagEstimate) -> tuple[str, str]:
    """The quantity's label, and its result in its own unit."""
    unit = f" {quantity.unit}" if quantity.unit else ""
    verdict = "worth correcting" if one.advised else "not worth correcting"
    return quantity.label, (
        f"delay {one.lag.delay_s:g} s, time constant {one.lag.tau_s:g} s: rms difference "
        f"{one.before:.3g} -> {one.after:.3g}{unit}, {verdict}"
    )
