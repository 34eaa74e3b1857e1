"""The report: one HTML page that holds everything, pictures included."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.figure import Figure

from grebe.checked import corrected_values, stored_lags
from grebe.errors import InputError
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, QuantityMap, map_all
from grebe.report import figures
from grebe.store import Progress, SampleTable, SurveyFile, TrackTable
from grebe.survey import Event, Survey


@dataclass(frozen=True, kw_only=True)
class ReportData:
    """What the page is made of, read once from the survey file."""

    survey: Survey
    meta: dict[str, str]
    progress: Progress
    track: TrackTable
    samples: SampleTable
    events: Sequence[Event]
    maps: Sequence[QuantityMap]
    left_out: Sequence[str]

    @property
    def in_window(self) -> int:
        """Samples inside a target set and its speed window."""
        inside = 0
        for position, seq, speed in zip(
            self.samples.positions, self.samples.target_seq, self.samples.speed_mps, strict=True
        ):
            if seq > 0:
                target = self.survey.targets[seq - 1].set
                covered = target.footprint_distance(*position) < 1e-3
                inside += covered and target.allows(speed)
        return inside


def gather(
    survey_file: SurveyFile,
    resolution_m: float | None = None,
    settings: MapSettings | None = None,
) -> ReportData:
    """Read a survey file and map its samples."""
    samples = survey_file.samples()
    survey = survey_file.survey
    grid = make_grid(survey.water, resolution_m)
    mapper = Mapper(survey.water, grid, settings or MapSettings())
    values = corrected_values(samples, stored_lags(survey_file))
    maps, left_out = map_all(mapper, samples.positions, values, samples.flags)
    return ReportData(
        survey=survey,
        meta=survey_file.meta(),
        progress=survey_file.progress(),
        track=survey_file.track(),
        samples=samples,
        events=survey_file.events(),
        maps=maps,
        left_out=left_out,
    )


def render(data: ReportData) -> str:
    """Return the page as HTML."""
    package = resources.files("grebe.report") / "templates" / "report.html"
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["figures"] = _significant
    template = environment.from_string(package.read_text(encoding="utf-8"))
    return template.render(
        data=data,
        survey=data.survey,
        finding=_finding(data),
        facts=_facts(data),
        rows=[_row(one) for one in data.maps],
        track_picture=_embed(figures.track_figure(data.survey, data.track, data.samples)),
        series_picture=_embed(figures.series_figure(data.survey, data.track))
        if len(data.track) and data.survey.targets
        else "",
        maps=[
            (one, _embed(figures.map_figure(data.survey, one, data.samples))) for one in data.maps
        ],
        warnings=[event for event in data.events if event.level != "info"],
    )


def write_report(path: Path, data: ReportData) -> None:
    """Render the page and write it to `path`."""
    page = render(data)
    try:
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}.") from None


def _finding(data: ReportData) -> str:
    targets = len(data.survey.targets)
    if not targets:
        return f"{len(data.samples)} samples of an imported track were mapped."
    reached = data.progress.reached
    if reached == targets:
        return f"All {targets} target sets were reached and {len(data.samples)} samples taken."
    return (
        f"{reached} of {targets} target sets were reached, {targets - reached} were missed; "
        f"{len(data.samples)} samples were taken."
    )


def _facts(data: ReportData) -> list[tuple[str, str]]:
    survey = data.survey
    facts = [("Area", f"{survey.water.area / 1e4:.2f} ha")]
    if survey.targets:
        share = data.progress.reached / len(survey.targets)
        facts += [
            (
                "Target sets reached",
                f"{data.progress.reached} of {len(survey.targets)} ({share:.1%})",
            ),
            ("Water within target sets", f"{survey.coverage:.1%}"),
            ("Samples in set and speed window", f"{data.in_window} of {len(data.samples)}"),
        ]
    if len(data.track):
        steps = np.diff(data.track.states[:, :2], axis=0)
        facts += [
            ("Duration", f"{data.track.seconds[-1] / 60:.1f} min"),
            ("Track", f"{np.hypot(*steps.T).sum():.0f} m"),
            ("Began", f"{data.track.times[0]:%Y-%m-%d %H:%M} UTC"),
        ]
    elif len(data.samples):
        facts.append(("Began", f"{data.samples.times[0]:%Y-%m-%d %H:%M} UTC"))
    if survey.vessel is not None:
        facts.append(("Vessel", survey.vessel.name))
    facts.append(("Water", data.meta.get("water", "measured")))
    facts.append(("Grebe", data.meta.get("software_version", "")))
    return facts


def _row(one: QuantityMap) -> dict[str, object]:
    inside = one.mean[one.grid.inside]
    return {
        "label": one.quantity.label,
        "unit": one.quantity.unit,
        "median": float(np.median(inside)),
        "low": float(np.percentile(inside, 5)),
        "high": float(np.percentile(inside, 95)),
        "error95": 1.96 * float(np.median(one.sd[one.grid.inside])),
        "samples": one.samples,
        "flagged": one.flagged,
    }


def _significant(value: float, digits: int = 4) -> str:
    """A number with so many significant figures, never in exponents for ordinary sizes."""
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{min(decimals, 8)}f}"


def _embed(figure: Figure) -> str:
    encoded = base64.b64encode(figures.png_bytes(figure)).decode("ascii")
    return f"data:image/png;base64,{encoded}"
