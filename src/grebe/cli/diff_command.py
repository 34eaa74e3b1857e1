"""grebe diff: what changed between two surveys of the same water."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from grebe.cli import options, output
from grebe.workflow.differences import compare_surveys, write_changes


@click.command(name="diff")
@click.argument("earlier", type=options.EXISTING)
@click.argument("later", type=options.EXISTING)
@click.option("--out", type=options.FOLDER, required=True, help="Folder for the maps.")
@click.option("--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m].")
@options.json_option
def command(
    earlier: Path, later: Path, out: Path, resolution_m: float | None, as_json: bool
) -> None:
    """Map LATER less EARLIER where both surveys cover the water: GeoTIFF and picture each."""
    changes = compare_surveys(earlier, later, resolution_m)
    for text in changes.left_out:
        output.note(f"left out: {text}")
    written = write_changes(changes, out)
    rows: dict[str, Any] = {}
    for key, change in changes.by_quantity.items():
        inside = change.before.grid.inside
        rows[key] = {
            "mean_difference": float(change.difference.mean[inside].mean()),
            "changed_share": float(np.mean(change.difference.clear[inside])),
            "file": str(written[key]),
        }
    output.result(
        rows if as_json else {key: _sentence(row) for key, row in rows.items()},
        as_json=as_json,
        next_command=f"look at {out}",
    )


def _sentence(row: dict[str, Any]) -> str:
    share, mean = row["changed_share"], row["mean_difference"]
    return f"{mean:+.3g} on average; clear, node by node (95 %), on {share:.0%} of the area"
