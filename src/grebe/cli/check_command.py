"""grebe check: quality control of the samples."""

from __future__ import annotations

from pathlib import Path

import click

from grebe.cli import options, output
from grebe.core.errors import InputError, UsageError
from grebe.core.quantities import Quantities
from grebe.io.readers.limits import read_limits
from grebe.io.store import SurveyFile
from grebe.mapping.lag import Lag
from grebe.workflow.quality import check_samples


@click.command(name="check")
@click.argument("file", type=options.EXISTING)
@click.option(
    "--limits",
    "limits_file",
    type=options.EXISTING,
    help="TOML file of the tests' limits for this water.",
)
@click.option(
    "--lag",
    "lags",
    multiple=True,
    metavar="KEY=DELAY[,TAU]",
    help="Lag of a sensor [s], a delay and a time constant, which the maps correct; 0 removes it.",
)
@click.option("--sensors", help="Description of the sensors and their calibration, for the report.")
@click.option("--positions", help="Description of how accurate positions are, for the report.")
@options.json_option
def command(
    file: Path,
    limits_file: Path | None,
    lags: tuple[str, ...],
    sensors: str | None,
    positions: str | None,
    as_json: bool,
) -> None:
    """Check the samples of FILE with QARTOD's tests and store a flag beside each value."""
    with SurveyFile.open(file) as survey_file:
        survey_file.claim()
        known = survey_file.quantities
        found = dict(_lag(text, known) for text in lags)
        limits = None if limits_file is None else read_limits(limits_file, known)
        if not survey_file.count("samples"):
            raise InputError(f"{file} holds no samples yet.")
        quality = check_samples(survey_file, limits)
        if found:
            survey_file.note_lags(found)
        lags_known = survey_file.lags()
        for name, text in (("sensors", sensors), ("positions", positions)):
            if text is not None:
                survey_file.set_meta(name, text)
    for text in quality.notes:
        output.note(f"note: {text}")
    output.result(
        {
            "good": {key: int((flags == 1).sum()) for key, flags in quality.flags.items()},
            "lags": {key: (one.delay_s, one.tau_s) for key, one in lags_known.items()} or None,
            "found": _found(quality.counts) if not as_json else quality.counts,
        },
        as_json=as_json,
        next_command=f"grebe map {output.quoted(file)} --out maps",
    )


def _found(counts: dict[str, dict[str, tuple[int, int]]]) -> list[str]:
    """The findings of the tests, in words."""
    return [
        f"{key}: {test} {suspect} suspect, {failed} failed"
        for key, tests in counts.items()
        for test, (suspect, failed) in tests.items()
        if suspect or failed
    ]


def _lag(text: str, known: Quantities) -> tuple[str, Lag]:
    """Parse KEY=DELAY[,TAU]."""
    key, _, numbers = text.partition("=")
    if key not in known:
        raise UsageError(
            f"--lag {text!r}: there is no quantity {key!r}; choose one of {known.keys_text}."
        )
    try:
        delay, *tau = (float(number) for number in numbers.split(","))
        return key, Lag(delay_s=delay, tau_s=tau[0] if tau else 0.0)
    except (ValueError, IndexError):
        raise UsageError(f"--lag {text!r} is not KEY=DELAY[,TAU] in seconds.") from None
