"""grebe import: turn a hand-driven track into a survey file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click
import numpy as np

from grebe.cli import options, output
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag
from grebe.io.readers.clock import EARLIEST_S, LATEST_S
from grebe.workflow.joining import ClockOffset
from grebe.workflow.tracks import ImportedTrack, import_track

# The failed tests of a quantity are printed if its share of good values is below this.
MOSTLY_GOOD = 0.8


@click.command(name="import")
@click.argument("tracks", metavar="TRACK...", type=options.EXISTING, nargs=-1, required=True)
@click.option("-o", "--output", "path", type=options.OUTPUT, required=True, help="Survey file.")
@click.option(
    "--with",
    "sondes",
    type=options.EXISTING,
    multiple=True,
    help="The sonde's file, joined to the track by time. With several tracks, one for each or one "
    "for all.",
)
@click.option(
    "--zone", help="Time zone of times that name none, such as Europe/Paris.  [default: UTC]"
)
@click.option(
    "--profile",
    help="Description of the logger's file: a TOML file, or the name of a known one (catabot).",
)
@click.option(
    "--clock-offset",
    "clock_offset_s",
    type=float,
    help="Time by which the sonde's clock is ahead of the track's [s].  [default: estimated from "
    "the data]",
)
@options.column_options
@options.quantities_option
@options.force_option
@options.json_option
def command(
    tracks: tuple[Path, ...],
    path: Path,
    columns: tuple[str, ...],
    header_from: Path | None,
    sondes: tuple[Path, ...],
    zone: str | None,
    profile: str | None,
    clock_offset_s: float | None,
    quantities_file: Path | None,
    force: bool,
    as_json: bool,
    **named: str | None,
) -> None:
    """Import the data of one TRACK, or of several outings on one lake; their convex hull becomes
    the region.

    TRACK is a logger's table, a GPX file, an ArduPilot .tlog or .bin, a Sea-Bird .cnv, or NMEA
    sentences.
    """
    for track in tracks:
        options.refuse_same(track, options.checked_output(path))
    done = import_track(
        tracks,
        path,
        columns=options.track_columns(columns, named),
        header_from=header_from,
        quantities_file=quantities_file,
        force=force,
        sondes=sondes,
        zone=zone,
        profile=profile,
        clock_offset_s=clock_offset_s,
    )
    for track, offset in zip(tracks, done.offsets, strict=bool(done.offsets)):
        output.note(f"{track}: {_offset_text(offset, clock_offset_s)}")
    missing = [one.label for key, one in LIMNOLOGICAL.items() if key not in done.quantities]
    _say(tracks, done, [f"no column for {label}: left out" for label in missing])
    flags = done.quality.flags
    output.result(
        {
            "name": done.survey.name,
            "samples": done.samples,
            "origin": options.place_text(done.survey.frame),
            "times": _span_text(done),
            "area_m2": round(done.survey.water.area, 1),
            "columns": [f"{key}: {name}" for key, name in done.raw.columns.items()],
            "good": {key: int((flags[key] == Flag.GOOD).sum()) for key in done.raw.values},
            "left_out": missing,
            "file": str(path),
        },
        as_json=as_json,
        next_command=f"grebe map {output.quoted(path)} --out maps",
    )


def _say(tracks: Sequence[Path], done: ImportedTrack, missing: Sequence[str]) -> None:
    """Print what a user should know of the data."""
    whose = f"{tracks[0]}: " if len(tracks) == 1 else ""
    if done.raw.unused:
        output.note(f"{whose}columns not used: {', '.join(done.raw.unused)}")
    # The notes of several tracks begin with their names.
    for text in (*done.raw.notes, *missing, *_flagged(done), *_time_notes(done)):
        output.note(whose + text)


def _span_text(done: ImportedTrack) -> str:
    """The times of the first and the last sample, which show a wrong day, month or time zone."""
    times = done.raw.times
    known = [] if times is None else times[np.isfinite(times)].tolist()
    if not known or min(known) < EARLIEST_S or max(known) > LATEST_S:
        return "unknown"
    first, last = (datetime.fromtimestamp(one, UTC) for one in (min(known), max(known)))
    return f"{first:%Y-%m-%d %H:%M:%S} to {last:%Y-%m-%d %H:%M:%S} UTC"


def _flagged(done: ImportedTrack) -> list[str]:
    """For each quantity with many flagged values, the tests that flagged them."""
    said: list[str] = []
    for key, tests in done.quality.counts.items():
        flags = done.quality.flags[key]
        good, there = int((flags == Flag.GOOD).sum()), int((flags != Flag.MISSING).sum())
        worst = {name: sum(counts) for name, counts in tests.items() if sum(counts)}
        if worst and good < MOSTLY_GOOD * there:
            by = ", ".join(f"{name} {count}" for name, count in worst.items())
            said.append(f"{key}: {good} of {there} values are good; flagged by {by}")
    without = [key for key in done.without_good if key not in done.quality.counts]
    return said + [f"no good value of {key}: missing, or text" for key in without]


def _time_notes(done: ImportedTrack) -> list[str]:
    """A note if no survey can have these times: the clock was not set, or it is a counter."""
    times = done.raw.times
    if times is None or EARLIEST_S < float(times[0]) < LATEST_S:
        return []
    return [
        f"the times begin at {times[0]:g} s after 1970, so the day of the survey is unknown; give "
        "dates and times, or seconds since 1970"
    ]


def _offset_text(told: ClockOffset | None, given: float | None) -> str:
    if told is not None:
        return (
            f"the sonde's clock is {told.seconds:+d} s ahead, estimated from {told.key} in both "
            f"files (correlation {told.correlation:.2f}): corrected"
        )
    if given is not None:
        return f"the sonde's clock is taken as {given:+g} s ahead, as given"
    return "the data do not determine the offset between the clocks: taken as zero"
