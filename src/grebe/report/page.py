"""The report: one HTML page that holds everything, pictures included."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.figure import Figure

from grebe.core.quantity import inline
from grebe.core.survey import Survey
from grebe.io.atomic_write import write_text_whole
from grebe.mapping.maps import Each, in_turn
from grebe.mapping.proof.validation import Z95
from grebe.mapping.quantity_map import QuantityMap
from grebe.report import canvas, map_figures, mission_figures
from grebe.report.bathymetry import bathymetry_of, hypsographic_figure
from grebe.report.data import ReportData
from grebe.report.method_text import after_number, method_text, significant
from grebe.report.movie_figures import movie_figure
from grebe.report.reasons import left_out_in
from grebe.report.tables import area_classes, measured_quantities, moment_text, stations
from grebe.report.texts import Texts, texts_of
from grebe.report.thresholds import Profile, Threshold, read_profile

# A threshold is reported if more than this share of the area is expected on the side of concern.
CONCERN_SHARE = 0.01
MOST_EVENTS, MOST_STATIONS = 50, 60


@dataclass(frozen=True, kw_only=True)
class Concern:
    """A threshold applied to a map; `share` of the area is expected on the side of concern."""

    one: QuantityMap
    threshold: Threshold
    share: float


def render(
    data: ReportData,
    profile: Profile | None = None,
    language: str = "en",
    each: Each = in_turn,
) -> str:
    """Return the page as HTML; `each` draws the picture of each quantity."""
    profile, texts = profile or read_profile(None), texts_of(language)
    package = resources.files("grebe.report") / "templates" / "report.html"
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["figures"] = partial(_figures, texts)
    environment.filters["number"] = texts.number
    concerns = _concerns(data, profile)
    template = environment.from_string(package.read_text(encoding="utf-8"))
    return template.render(
        data=data,
        survey=data.survey,
        t=texts,
        finding=_finding(data, texts),
        cautions=_cautions(data, texts),
        left_out=[left_out_in(one, data.quantities, texts) for one in data.left_out],
        alerts=_alerts(concerns, texts),
        facts=_facts(data, texts),
        rows=[_row(one, texts) for one in data.maps],
        concerns=concerns,
        profile=profile,
        track_picture=_embed(
            mission_figures.track_figure(data.survey, data.track, data.samples, texts), texts
        ),
        series_picture=_embed(mission_figures.series_figure(data.survey, data.track, texts), texts)
        if len(data.track) and data.survey.targets
        else "",
        maps=list(
            zip(data.maps, each(_Pictured(data.survey, profile, texts), data.maps), strict=True)
        ),
        bathymetry=_bathymetry(data, texts),
        movies=_movies(data, texts),
        untold=_untold(data, texts),
        methods=[method_text(data, one, texts) for one in data.maps],
        hatched=[map_figures.is_hatched(one) for one in data.maps],
        classes=[_classes(one, texts) for one in data.maps],
        stations=stations(data),
        most_stations=MOST_STATIONS,
        moment=moment_text,
        measured_quantities=measured_quantities(data),
        paragraph=_paragraph(data, texts),
        citation=_citation(data, texts),
        quality=_quality(data, texts),
        measured=_measured(data, texts),
        warnings=[event for event in data.events if event.level != "info"][:MOST_EVENTS],
    )


def _figures(t: Texts, value: float, digits: int = 4) -> str:
    return t.number(significant(value, digits))


def write_report(
    path: Path,
    data: ReportData,
    profile: Profile | None = None,
    language: str = "en",
    each: Each = in_turn,
) -> None:
    """Render the page and write it to `path`; see `render`."""
    write_text_whole(path, render(data, profile, language, each))


def _finding(data: ReportData, t: Texts) -> str:
    if not data.maps:
        return t("finding_none", samples=len(data.samples))
    return t(
        "finding_one" if len(data.maps) == 1 else "finding",
        quantities=len(data.maps),
        area=t.number(f"{data.survey.water.area / 1e4:.2f}"),
        where=t["within_hull"] if data.is_of_track else "",
        samples=t.number(f"{len(data.samples):,}"),
    )


def _cautions(data: ReportData, t: Texts) -> list[str]:
    """What a reader must know before any number: that nothing was measured, or not everywhere, or
    not at one time.
    """
    targets, reached = len(data.survey.targets), data.progress.reached
    cautions = [t["simulated"]] if data.is_simulated else []
    if reached < targets and len(data.samples):
        cautions.append(t("incomplete", reached=reached, targets=targets, cells=data.unsampled))
    count, pause_s = data.samples.outings()
    if count > 1:
        cautions.append(t("several_outings", count=count, longest=_duration(pause_s, t)))
    for one in data.maps:
        cautions += _below_zero(data, one, t)
    return cautions


def _below_zero(data: ReportData, one: QuantityMap, t: Texts) -> list[str]:
    """A caution on readings and parts of a map that are below 0, if there are any."""
    below = data.below_zero(one)
    if below is None:
        return []
    told = {"label": one.quantity.label_in(t.language), "unit": one.quantity.unit}
    texts: list[str] = []
    if below.count:
        least = t.number(f"{below.least:.3g}")
        texts.append(t("below_zero", **told, count=below.count, of=below.of, least=least))
    if below.mapped_share:
        share, least = t.share(below.mapped_share, 1), t.number(f"{below.mapped_least:.2g}")
        texts.append(t("map_below_zero", **told, share=share, least=least))
    return texts


def _concerns(data: ReportData, profile: Profile) -> list[Concern]:
    return [
        Concern(
            one=one,
            threshold=threshold,
            share=float(np.nanmean(threshold.probability(one))),
        )
        for one in data.maps
        for threshold in profile.of(one)
    ]


def _alerts(concerns: list[Concern], t: Texts) -> list[str]:
    return [
        t(
            "concern",
            label=each.one.quantity.label_in(t.language),
            share=t.share(each.share),
            sense=t[each.threshold.sense],
            value=t.number(f"{each.threshold.value:g}"),
            unit=after_number(each.one.quantity.unit),
            text=each.threshold.label(t.language),
        )
        for each in concerns
        if each.share > CONCERN_SHARE
    ]


def _facts(data: ReportData, t: Texts) -> list[tuple[str, str]]:
    survey, progress = data.survey, data.progress
    facts = [(t["area"], t.number(f"{survey.water.area / 1e4:.2f} ha"))]
    if survey.targets:
        targets = len(survey.targets)
        share = t.share(progress.reached / targets, 1)
        samples = len(data.samples)
        facts += [
            (t["reached"], t("reached_value", reached=progress.reached, targets=targets,
                             share=share)),
            (t["unsampled"], str(data.unsampled)),
            (t["within"], t.share(survey.coverage, 1)),
            (t["window"], t("of", part=data.in_window, whole=samples)),
        ]  # fmt: skip
    if len(data.track):
        steps_of_boats = [np.diff(one.states[:, :2], axis=0) for one in data.track.each_boat()]
        facts += [
            (t["duration"], _duration(float(data.track.seconds[-1]), t)),
            (t["track"], f"{sum(np.hypot(*steps.T).sum() for steps in steps_of_boats):.0f} m"),
            (t["began"], f"{data.track.times[0]:%Y-%m-%d %H:%M} UTC"),
        ]
    elif len(data.samples):
        steps = np.diff(data.samples.positions, axis=0)
        last = float(data.samples.times[-1] - data.samples.times[0])
        facts += [
            (t["duration"], _duration(last, t)),
            (t["track"], f"{np.hypot(*steps.T).sum():.0f} m"),
            (t["began"], f"{data.samples.moment(0):%Y-%m-%d %H:%M} UTC"),
        ]
    return facts


def _duration(seconds: float, t: Texts) -> str:
    if seconds > 86_400:
        return t.number(f"{seconds / 86_400:.1f} {t['days']}")
    return t.number(f"{seconds / 60:.1f} min")


def _row(one: QuantityMap, t: Texts) -> dict[str, object]:
    inside = one.mean[one.grid.inside]
    return {
        "label": one.quantity.label_in(t.language),
        "unit": one.quantity.unit,
        "median": float(np.median(inside)),
        "low": float(np.percentile(inside, 5)),
        "high": float(np.percentile(inside, 95)),
        "error95": one.error95,
        "samples": one.samples,
        "flagged": one.flagged,
    }


def _classes(one: QuantityMap, t: Texts) -> str:
    """The shares of the area by class, as a sentence."""
    said: list[str] = []
    for each in area_classes(one):
        bounds = {"low": t.number(f"{each.low:.6g}"), "high": t.number(f"{each.high:.6g}")}
        ends = (np.isfinite(each.low), np.isfinite(each.high))
        kind = {(False, True): "class_below", (True, False): "class_above",
                (True, True): "class_between"}.get(ends, "class_all")  # fmt: skip
        said.append(f"{t(kind, **bounds)}{t['colon']}{t.share(each.share)}")
    unit = f" [{one.quantity.unit}]" if one.quantity.unit else ""
    return t("classes", unit=unit, classes="; ".join(said))


def _paragraph(data: ReportData, t: Texts) -> str:
    """The methods of the survey and its maps, as a paragraph for a paper."""
    samples = data.samples
    if not data.maps or not len(samples):
        return ""
    vessel = data.survey.vessel
    validated = [one.validation for one in data.maps if one.validation is not None]
    text = t(
        "paragraph",
        name=data.survey.name,
        area=t.number(f"{data.survey.water.area / 1e4:.2f}"),
        lat=_degrees(data.survey.frame.origin_lat_deg, 4, t["north_south"], t),
        lon=_degrees(data.survey.frame.origin_lon_deg, 4, t["east_west"], t),
        first=moment_text(float(samples.times.min())),
        last=moment_text(float(samples.times.max())),
        vessel=t["a_boat"] if vessel is None else t("a_vessel", vessel=vessel.name),
        sensors=data.meta.get("sensors", t["sensors_not_stated"]),
        samples=t.number(f"{len(samples):,}"),
        quantities=", ".join(inline(one.quantity.label_in(t.language)) for one in data.maps),
        methods="; ".join(dict.fromkeys(_method_name(one, t) for one in data.maps)),
        step=t.number(f"{data.maps[0].grid.step_m:.1f}"),
        version=data.meta.get("software_version", ""),
    )
    if validated:
        held = [one.coverage95 for one in validated]
        text += " " + t("paragraph_checked", least=t.share(min(held)), most=t.share(max(held)))
    return f"{t['simulated']} {text}" if data.is_simulated else text


def _degrees(value_deg: float, decimals: int, sides: str, t: Texts) -> str:
    """Format a latitude or longitude; `sides` has the letters of its positive and negative side."""
    return f"{t.number(f'{abs(value_deg):.{decimals}f}')}° {sides[value_deg < 0]}"


def _method_name(one: QuantityMap, t: Texts) -> str:
    return t["methods_named"].get(one.method.key) or inline(one.method.label)


def _citation(data: ReportData, t: Texts) -> str:
    return t("citation", version=data.meta.get("software_version", ""))


def _movies(data: ReportData, t: Texts) -> list[tuple[str, str]]:
    """A sentence on each movie, and its picture."""
    return [
        (
            t(
                "movie_text",
                label=one.still.quantity.label_in(t.language),
                count=len(one.times_s),
                minutes=t.number(f"{float(one.times_s[1] - one.times_s[0]) / 60:g}"),
            ),
            _embed(movie_figure(data.survey, one, t), t),
        )
        for one in data.movies or ()
    ]


def _untold(data: ReportData, t: Texts) -> str:
    """The quantities for which a movie was requested but could not be made."""
    return ", ".join(inline(one.label_in(t.language)) for one in data.still)


def _bathymetry(data: ReportData, t: Texts) -> list[tuple[str, str]]:
    """A sentence on the lake from a map of depths, and its hypsographic curve."""
    lakes = [lake for one in data.maps if (lake := bathymetry_of(one, data.survey)) is not None]
    return [
        (
            t(
                "bathymetry",
                **_volume(lake.volume_m3, Z95 * lake.volume_sd_m3, t),
                mean=t.number(significant(lake.mean_depth_m, 3)),
                deepest=t.number(significant(lake.max_depth_m, 3)),
                area=t.number(f"{lake.area_m2 / 1e4:.2f}"),
                where=t["within_hull"] if data.is_of_track else "",
            ),
            _embed(hypsographic_figure(lake, t), t),
        )
        for lake in lakes
    ]


def _volume(volume: float, error: float, t: Texts) -> dict[str, str]:
    """Format a volume and its error, both rounded to the second digit of the error."""
    step = 10.0 ** (np.floor(np.log10(error)) - 1) if error > 0 else 1.0
    rounded = (f"{round(one / step) * step:,.0f}" for one in (volume, error))
    return dict(zip(("volume", "error"), map(t.number, rounded), strict=True))


def _quality(data: ReportData, t: Texts) -> list[tuple[str, str, int, int]] | None:
    """Quantity, test, and numbers of suspect and failed values, for tests that flagged any."""
    if data.quality is None:
        return None
    return [
        (data.quantities.known(key).label_in(t.language), test, suspect, failed)
        for key, tests in data.quality.items()
        for test, (suspect, failed) in tests.items()
        if suspect or failed
    ]


def _measured(data: ReportData, t: Texts) -> list[tuple[str, str]]:
    meta, frame = data.meta, data.survey.frame
    vessel = data.survey.vessel
    unknown = str(t["not_stated"])
    return [
        (t["vessel"], unknown if vessel is None else vessel.name),
        (t["sensors"], meta.get("sensors", unknown)),
        (t["positions"], meta.get("positions", unknown)),
        (t["water"], meta.get("water", unknown)),
        (t["crs"], t("crs_text", lat=_degrees(frame.origin_lat_deg, 6, t["north_south"], t),
                     lon=_degrees(frame.origin_lon_deg, 6, t["east_west"], t))),
        (t["software"], f"Grebe {meta.get('software_version', '')}"),
        (t["configuration"], meta.get("configuration_hash", "")[:12]),
        (t["survey_id"], f"{meta.get('survey_id', '')}, {meta.get('created', '')}"),
    ]  # fmt: skip


@dataclass(frozen=True)
class _Pictured:
    """Called with a map, draws all pictures of its quantity."""

    survey: Survey
    profile: Profile
    texts: Texts

    def __call__(self, one: QuantityMap) -> str:
        thresholds = self.profile.of(one)
        figure = map_figures.quantity_figure(self.survey, one, thresholds, self.texts)
        return _embed(figure, self.texts)


def _embed(figure: Figure, t: Texts) -> str:
    encoded = base64.b64encode(canvas.png_bytes(canvas.localise(figure, t))).decode("ascii")
    return f"data:image/png;base64,{encoded}"
