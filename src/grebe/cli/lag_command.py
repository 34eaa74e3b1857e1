"""grebe lag: estimate the sensors' lag where one line was run twice."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np

from grebe.cli import options, output
from grebe.core.errors import InputError
from grebe.core.quantities import QUANTITIES
from grebe.core.samples import Flag
from grebe.io.store import SampleTable, SurveyFile
from grebe.mapping.lag import LagEstimate, Pass, estimate_lag

LONGEST_APART_S = 6 * 3600.0


@click.command(name="lag")
@click.argument("first", type=options.EXISTING)
@click.argument("second", type=options.EXISTING)
@options.json_option
def command(first: Path, second: Path, as_json: bool) -> None:
    """Compare two runs of one line, FIRST and SECOND, at different speeds or directions.

    For each quantity the delay and time constant that bring the runs closest, and whether
    that is worth a correction: what the water itself did between the runs no lag explains.
    """
    with SurveyFile.open(first) as one, SurveyFile.open(second) as other:
        frame = one.survey.frame
        tables = one.samples(), other.samples()
        places = (
            tables[0].positions,
            frame.to_local(other.survey.frame.to_wgs84(tables[1].positions)),
        )
    apart_s = abs(np.median(_seconds(tables[0])) - np.median(_seconds(tables[1])))
    if apart_s > LONGEST_APART_S:
        raise InputError(
            f"{first} and {second} were measured {apart_s / 3600:.0f} h apart: the water itself "
            "has changed since; a lag needs two runs of one line within hours."
        )
    found: dict[str, LagEstimate] = {}
    for quantity in QUANTITIES:
        passes = [_pass(table, at, quantity.key) for table, at in zip(tables, places, strict=True)]
        if min(len(run.times) for run in passes) == 0:
            continue
        try:
            found[quantity.key] = estimate_lag(*passes)
        except ValueError as error:
            raise InputError(f"{first} and {second}: {error}.") from None
    if not found:
        raise InputError(f"{first} and {second} have no quantity in common.")
    advised = " ".join(
        f"--lag {key}={one.lag.delay_s:g},{one.lag.tau_s:g}"
        for key, one in found.items()
        if one.advised
    )
    output.result(
        {key: _row(one, as_json=as_json) for key, one in found.items()},
        as_json=as_json,
        next_command=f"grebe check {first} {advised}"
        if advised
        else "grebe map: no correction is worth making",
    )


def _pass(table: SampleTable, positions: np.ndarray, key: str) -> Pass:
    good = np.isin(table.flags[key], Flag.USABLE) & np.isfinite(table.values[key])
    return Pass(
        times=_seconds(table)[good], positions=positions[good], values=table.values[key][good]
    )


def _seconds(table: SampleTable) -> np.ndarray:
    return np.array([moment.timestamp() for moment in table.times])


def _row(one: LagEstimate, *, as_json: bool) -> Any:
    if as_json:
        return asdict(one) | {"gain": one.gain, "advised": one.advised}
    verdict = "worth correcting" if one.advised else "not worth correcting"
    return (
        f"delay {one.lag.delay_s:g} s, time constant {one.lag.tau_s:g} s: rms difference "
        f"{one.before:.3g} -> {one.after:.3g}, {verdict}"
    )
