"""Reads NMEA 0183 sentences: position, motion, heading, turn, and the readings of probes.

pynmea2 parses the sentences and checks their sums. Each becomes plain records in SI units, or
nothing if it is damaged, not used here, or marked as invalid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

KNOT_MPS = 1852.0 / 3600.0
# The talkers accepted: receivers of any system, compasses, integrated instruments, sounders,
# probes.
TALKERS = frozenset(
    ("GP", "GN", "GL", "GA", "GB", "GQ", "HE", "HC", "HN", "II", "IN", "TI", "SD", "YX", "WI")
)
# GGA's quality, in words, and the standard deviation of such a position [m]. Positions that are
# typed in (7) or dead reckoned (6) are not used.
QUALITIES: dict[int, tuple[str, float]] = {
    1: ("GPS", 1.0),
    2: ("DGPS", 0.5),
    3: ("PPS", 1.0),
    4: ("RTK fixed", 0.02),
    5: ("RTK float", 0.2),
    8: ("simulated", 0.02),
}
PLAIN_ERROR_M = QUALITIES[1][1]
# The longest line that is parsed [bytes]: a sentence has at most 82, and some senders exceed that.
LONGEST = 120


@dataclass(frozen=True, kw_only=True)
class Position:
    """A position: time of day [s], longitude and latitude [deg], the kind of fix in words, and the
    error [m]; RMC gives neither fix nor error.
    """

    second_of_day: float
    lonlat: tuple[float, float]
    fix: str = ""
    error_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class NoFix:
    """The receiver reports that it has no position."""


@dataclass(frozen=True, kw_only=True)
class Velocity:
    """Velocity over ground, north and east [m/s], and the time of day [s] if it is given."""

    velocity: tuple[float, float]
    second_of_day: float | None = None


@dataclass(frozen=True, kw_only=True)
class Heading:
    """The heading of the bow [rad], from true north or, unless `true`, from magnetic north."""

    heading_rad: float
    true: bool


@dataclass(frozen=True, kw_only=True)
class Variation:
    """The variation: how far magnetic north is east of true north [rad]."""

    east_rad: float


@dataclass(frozen=True, kw_only=True)
class TurnRate:
    """Yaw rate [rad/s], positive to starboard."""

    rate_radps: float


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A probe's reading of one quantity."""

    key: str
    value: float


Record = Position | NoFix | Velocity | Heading | Variation | TurnRate | Reading


def read_sentence(line: bytes) -> tuple[Record, ...] | None:
    """Return the records of a sentence, in its order, empty if it is not used. Return None if it is
    damaged: not ASCII, too long, its sum missing or wrong, or a number that cannot be read.
    """
    import pynmea2

    _know_ths()
    if len(line) > LONGEST:
        return None
    try:
        sentence: Any = pynmea2.parse(line.decode("ascii"), check=True)
    except pynmea2.SentenceTypeError:
        return ()
    except (pynmea2.ParseError, UnicodeDecodeError, ValueError):
        return None
    reader = _READERS.get(getattr(sentence, "sentence_type", ""))
    if reader is None or sentence.talker not in TALKERS:
        return ()
    try:
        record = reader(sentence)
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError):
        # A field is empty or not a number: pynmea2 then returns its text.
        return None
    return record if _finite(record) else None


@cache
def _know_ths() -> None:
    """Register THS, the true heading with its mode, which pynmea2 lacks."""
    import pynmea2

    fields = (("Heading, true", "heading", float), ("Mode", "mode"))
    type("THS", (pynmea2.TalkerSentence,), {"fields": fields})


def _gga(sentence: Any) -> tuple[Record, ...]:
    quality = QUALITIES.get(int(sentence.gps_qual or 0))
    if quality is None or not sentence.lat:
        return (NoFix(),)
    return (_place(sentence, *quality),)


def _rmc(sentence: Any) -> tuple[Record, ...]:
    if sentence.status != "A" or not sentence.lat:
        return (NoFix(),)
    place = _place(sentence)
    record: list[Record] = [place]
    speed = float(sentence.spd_over_grnd or 0.0) * KNOT_MPS
    velocity = _velocity(speed, sentence.true_course)
    if velocity is not None:
        record.append(Velocity(velocity=velocity, second_of_day=place.second_of_day))
    if sentence.mag_variation:
        record.append(Variation(east_rad=_signed(sentence.mag_variation, sentence.mag_var_dir)))
    return tuple(record)


def _vtg(sentence: Any) -> tuple[Record, ...]:
    speed = float(sentence.spd_over_grnd_kts) * KNOT_MPS
    velocity = _velocity(speed, sentence.true_track)
    return () if velocity is None else (Velocity(velocity=velocity),)


def _ths(sentence: Any) -> tuple[Record, ...]:
    """Read THS, but ignore estimated, typed-in, simulated and void headings (E, M, S, V)."""
    if sentence.mode != "A":
        return ()
    return (Heading(heading_rad=math.radians(float(sentence.heading)), true=True),)


def _hdg(sentence: Any) -> tuple[Record, ...]:
    heading = math.radians(float(sentence.heading))
    if sentence.deviation:
        heading += _signed(sentence.deviation, sentence.dev_dir)
    magnetic = Heading(heading_rad=heading, true=False)
    if not sentence.variation:
        return (magnetic,)
    return Variation(east_rad=_signed(sentence.variation, sentence.var_dir)), magnetic


def _heading(sentence: Any) -> tuple[Record, ...]:
    true = sentence.sentence_type == "HDT"
    return (Heading(heading_rad=math.radians(float(sentence.heading)), true=true),)


def _rot(sentence: Any) -> tuple[Record, ...]:
    """Read ROT, which is in degrees per minute, positive to starboard."""
    if sentence.status != "A":
        return ()
    return (TurnRate(rate_radps=math.radians(float(sentence.rate_of_turn)) / 60),)


def _mtw(sentence: Any) -> tuple[Record, ...]:
    return (Reading(key="temperature_degc", value=float(sentence.temperature)),)


def _dpt(sentence: Any) -> tuple[Record, ...]:
    """Read DPT, the depth below the transducer; a positive offset is the transducer's depth."""
    below, offset = float(sentence.depth), float(sentence.offset or 0.0)
    return (Reading(key="water_depth_m", value=below + max(offset, 0.0)),)


def _place(sentence: Any, fix: str = "", error_m: float | None = None) -> Position:
    when = sentence.timestamp
    lon, lat = float(sentence.longitude), float(sentence.latitude)
    if abs(lat) > 90 or abs(lon) > 180:
        raise ValueError
    seconds = 3600 * when.hour + 60 * when.minute + when.second + 1e-6 * when.microsecond
    return Position(second_of_day=seconds, lonlat=(lon, lat), fix=fix, error_m=error_m)


def _velocity(speed_mps: float, course_deg: Any) -> tuple[float, float] | None:
    """Return the velocity north and east [m/s]. Some receivers leave the course of a boat that
    hardly moves empty; a faster boat without a course has no velocity.
    """
    if course_deg in (None, ""):
        return (0.0, 0.0) if speed_mps < 0.2 else None
    course = math.radians(float(course_deg))
    return speed_mps * math.cos(course), speed_mps * math.sin(course)


def _signed(degrees: Any, side: Any) -> float:
    """Return an angle in radians, positive to the east."""
    if side not in ("E", "W"):
        raise ValueError
    return math.radians(float(degrees)) * (1 if side == "E" else -1)


def _finite(record: tuple[Record, ...]) -> bool:
    numbers = (
        number
        for one in record
        for value in vars(one).values()
        for number in (value if isinstance(value, tuple) else (value,))
        if isinstance(number, float)
    )
    return all(map(math.isfinite, numbers))


_READERS = {
    "GGA": _gga,
    "RMC": _rmc,
    "VTG": _vtg,
    "HDT": _heading,
    "HDM": _heading,
    "HDG": _hdg,
    "THS": _ths,
    "ROT": _rot,
    "MTW": _mtw,
    "DPT": _dpt,
}
