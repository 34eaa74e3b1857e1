"""grebe campaign: simulate thousands of missions and certify how often they succeed."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output


@click.command(name="campaign")
@click.argument("file", type=options.EXISTING)
@click.option(
    "--out", type=options.FOLDER, help="Folder for the results.  [default: FILE without its ending]"
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    help="Number of worker processes.  [default: one per core]",
)
@click.option("--dask", is_flag=True, help="Use a Dask cluster on this computer.")
@click.option("--scheduler", metavar="ADDRESS", help="Use the Dask cluster of this scheduler.")
@options.force_option
@options.json_option
def command(
    file: Path,
    out: Path | None,
    workers: int | None,
    dask: bool,
    scheduler: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Simulate the missions of FILE (TOML) until its claim about them is decided.

    An interrupted campaign continues when the same command is run again. The folder receives the
    missions as Parquet, and the certificate as a page, a picture and JSON.
    """
    from grebe.campaigns.engine import engine_of
    from grebe.campaigns.page import numbers, write_report
    from grebe.campaigns.reading import read_campaign
    from grebe.campaigns.results import Results
    from grebe.campaigns.run import run_campaign

    read = read_campaign(file)
    folder = out or file.with_suffix("")
    results = Results(folder, read.identity, force=force)
    engine = engine_of(workers, scheduler, dask=dask)
    output.compile_once()
    with output.Countdown("missions", read.campaign.missions, quiet=as_json) as countdown:
        outcome = run_campaign(read.campaign, read.survey, results, engine, countdown.update)
    written = write_report(outcome, folder)
    told = numbers(outcome) | {"files": [str(path) for path in written]}
    output.result(told, as_json=as_json, next_command=f"look at {folder / 'report.html'}")
