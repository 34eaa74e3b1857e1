"""The types of requests and answers, from which the description of the interface is made.

Positions are [longitude, latitude] in degrees (WGS 84), angles radians clockwise from north unless
their name ends in `_deg`, `t` and `_s` seconds, times ISO 8601 in UTC. Unknown values are null.
`web/src/api.ts` has the same types for the page.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

State = Literal[
    "planned", "running", "paused", "returning", "stopped", "interrupted", "complete", "imported"
]
GeoJSON = dict[str, Any]
LonLat = list[float]


class Label(TypedDict):
    """A word in both languages."""

    en: str
    fr: str


class Refusal(TypedDict):
    """What was wrong, in one sentence; `setting` names the setting at fault, if any."""

    code: str
    message: str
    setting: NotRequired[str]


class Failure(TypedDict):
    """The body of every answer with a status of 400 or more."""

    error: Refusal


class Summary(TypedDict):
    """One entry of the list of surveys."""

    id: str
    name: str
    created: str
    state: State
    cells: int
    reached: int
    samples: int
    area_m2: float


class QuantityShown(TypedDict):
    """A quantity with its first threshold of concern."""

    id: str
    label: Label
    unit: str
    threshold: float | None
    side: Literal["above", "below"]


class Choice(TypedDict):
    """One option of a choice."""

    id: str
    label: Label


class VesselChoice(Choice):
    """A boat for which a plan can be made."""

    speed_max_mps: float


class NumberSetting(TypedDict):
    """The limits of a setting."""

    unit: str
    default: float
    min: float
    max: float


class BackgroundShown(TypedDict):
    """A user's background map; `bounds` are west, south, east, north."""

    name: str
    min_zoom: int
    max_zoom: int
    bounds: list[float] | None
    attribution: str


class Options(TypedDict):
    """The choices, with limits and defaults."""

    version: str
    vessels: list[VesselChoice]
    patterns: list[Choice]
    rules: list[Choice]
    quantities: list[QuantityShown]
    settings: dict[str, NumberSetting]
    background: BackgroundShown | None


class Current(TypedDict):
    """A current, and the direction towards which it flows."""

    speed_mps: float
    towards_deg: float


class Wind(TypedDict):
    """The force of the wind on the boat, and the direction from which it blows."""

    force_n: float
    from_deg: float


class PlanWishes(TypedDict, total=False):
    """The settings of a plan; each has a default."""

    cell_m: float
    pattern: Literal["free", "rows", "columns"]
    speed_min_mps: float
    speed_max_mps: float
    vessel: str
    start: LonLat | None
    shore_margin_m: float
    no_go: GeoJSON | None
    current: Current | None
    wind: Wind | None
    minutes: float | None


class PlanRequest(TypedDict):
    """Water as a GeoJSON polygon, and the settings of its survey."""

    region: GeoJSON
    settings: PlanWishes
    name: NotRequired[str]


class Problem(TypedDict):
    """Why there is no plan, and which setting is at fault."""

    setting: str
    message: str


class Preview(TypedDict):
    """The plan of a survey that is not stored; `problems` if there is none."""

    targets: GeoJSON
    route: GeoJSON
    length_m: float
    time_s: float
    energy_wh: float | None
    samples: int
    area_m2: float
    expected_sd: dict[str, float] | None
    uncovered: GeoJSON | None
    uncovered_m2: float
    outside_m: float
    problems: list[Problem]
    notes: list[str]


class Outline(TypedDict):
    """The water in a file of outlines, and notes on what was left out or doubtful."""

    region: GeoJSON
    name: str
    notes: list[str]


class TargetShown(TypedDict):
    """A target set, by its number in the order of the route."""

    seq: int
    ring: list[LonLat]
    state: Literal["open", "current", "reached", "given_up"]


class Detail(Summary):
    """The details of a survey."""

    region: GeoJSON
    targets: list[TargetShown]
    route: GeoJSON | None
    settings: PlanWishes | None
    quantities: list[QuantityShown]
    link: str | None
    bounds: list[float]


class PreflightLine(TypedDict):
    """One of the doctor's checks; `ok` is null for a finding that is neither good nor bad."""

    line: Label
    ok: bool | None
    detail: str
    advice: str


class Weather(TypedDict, total=False):
    """The weather of simulated water."""

    current: Current | None
    wind: Wind | None


class RunRequest(TypedDict, total=False):
    """How to sail a survey; `confirm` is required for a boat that is not simulated."""

    link: str
    rule: str
    weather: Weather
    rate: float
    resume: bool
    force: bool
    confirm: bool


class Battery(TypedDict):
    """The charge left in the battery."""

    volt: float | None
    fraction: float | None


class Status(TypedDict):
    """What the boat does, and its progress; `t` counts from the start of the mission."""

    state: State
    doing: str
    t: float
    time: str | None
    link: str | None
    link_age_s: float | None
    battery: Battery | None
    solve_ms: float | None
    fix: str | None
    eta_s: float | None
    coverage: float
    reached: int
    targets: int
    samples: int
    rate: float


class LeaseRequest(TypedDict):
    """Whether to take the right to steer, or to release it."""

    take: bool


class LeaseShown(TypedDict):
    """Who steers: you, another page or script, or nobody."""

    holder: Literal["you", "other"] | None
    since: str | None


class Grid(TypedDict):
    """A layer of a map on a grid, given by its corners anticlockwise from the south-west.

    `values` is base64 of float32, little-endian, row by row from the south; NaN off the water.
    """

    quantity: str
    layer: Literal["mean", "sd", "probability", "quality", "difference"]
    nx: int
    ny: int
    corners: list[LonLat]
    values: str
    range: list[float] | None
    levels: list[float]
    unit: str
    version: int
    method: str
    samples: int
    note: str | None


class Value(TypedDict):
    """The value at a place with its 95 % interval."""

    mean: float
    sd: float
    low: float
    high: float
    unit: str


class Line(TypedDict):
    """Values along a line with their 95 % interval; null off the water."""

    distance_m: list[float]
    mean: list[float | None]
    low: list[float | None]
    high: list[float | None]
    unit: str


class LogLine(TypedDict):
    """An event of a mission."""

    t: float
    time: str
    level: Literal["info", "warning", "error"]
    code: str
    message: str


class TrackColumns(TypedDict):
    """The track of a mission, columns of one length."""

    t: list[float]
    lon: list[float]
    lat: list[float]
    heading_rad: list[float]
    surge_mps: list[float]


class SampleColumns(TypedDict):
    """The samples of a mission, columns of one length."""

    t: list[float]
    lon: list[float]
    lat: list[float]
    values: dict[str, list[float | None]]


class ReachedColumns(TypedDict):
    """The times at which targets were reached."""

    t: list[float]
    seq: list[int]


class Replay(TypedDict):
    """A recorded mission as columns."""

    track: TrackColumns
    samples: SampleColumns
    reached: ReachedColumns
    events: list[LogLine]


class ReportRequest(TypedDict, total=False):
    """The language of a report."""

    language: Literal["en", "fr"]


class ReportMade(TypedDict):
    """When the report was made."""

    made: str


class Empty(TypedDict, total=False):
    """An empty body."""
