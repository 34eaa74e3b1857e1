"""What sentences of NMEA 0183 say: position, motion, heading, turn, and what a probe reads.

Parsed by pynmea2, which checks their sums; here each becomes a plain record in SI units, or
nothing, where it is damaged, of no use to us, or says itself that it is not valid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

KNOT_MPS = 1852.0 / 3600.0
# Who may speak: receivers of any system, compasses, integrated instruments, sounders, probes.
TALKERS = frozenset(
    ("GP", "GN", "GL", "GA", "GB", "GQ", "HE", "HC", "HN", "II", "IN", "TI", "SD", "YX", "WI")
)
# GGA's quality, in words, and the standard deviation of such a position [m]. A position that was
# typed in (7) or guessed on (6) is nothing to steer by.
QUALITIES: dict[int, tuple[str, float]] = {
    1: ("GPS", 1.0),
    2: ("DGPS", 0.5),
    3: ("PPS", 1.0),
    4: ("RTK fixed", 0.02),
    5: ("RTK float", 0.2),
    8: ("simulated", 0.02),
}
PLAIN_ERROR_M = QUALITIES[1][1]
# Longer than any sentence that is one (82), with some room for those who do not count [bytes].
LONGEST = 120


@dataclass(frozen=True, kw_only=True)
class Place:
    """A position: time of day [s], longitude and latitude [deg]; how it was found in words and its
    error [m], which RMC does not tell.
    """

    second_of_day: float
    lonlat: tuple[float, float]
    fix: str = ""
    error_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class NoFix:
    """The receiver says that it does not know where it is."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Velocity over ground, north and east [m/s]; the time of day [s] where it is told."""

    velocity: tuple[float, float]
    second_of_day: float | None = None


@dataclass(frozen=True, kw_only=True)
class Bow:
    """Where the bow points [rad], from true north or, unless `true`, from magnetic north."""

    heading_rad: float
    true: bool


@dataclass(frozen=True, kw_only=True)
class Variation:
    """How far magnetic north lies east of true north [rad]."""

    east_rad: float


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Yaw rate [rad/s], positive to starboard."""

    rate_radps: float


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What a probe reads of a quantity."""

    key: str
    value: float


Said = Place | NoFix | Motion | Bow | Variation | Turn | Reading


def read_sentence(line: bytes) -> tuple[Said, ...] | None:
    """Return what a sentence says, in its order; None where it is damaged: not ASCII, its sum
    missing or wrong, or a number that cannot be read.
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
        said = reader(sentence)
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError):
        # An empty field is not a number: pynmea2 hands out what it could not turn into one as text.
        return None
    return said if _finite(said) else None


@cache
def _know_ths() -> None:
    """Teach pynmea2 the true heading with its mode, which it lacks."""
    import pynmea2

    fields = (("Heading, true", "heading", float), ("Mode", "mode"))
    type("THS", (pynmea2.TalkerSentence,), {"fields": fields})


def _gga(sentence: Any) -> tuple[Said, ...]:
    quality = QUALITIES.get(int(sentence.gps_qual or 0))
    if quality is None or not sentence.lat:
        return (NoFix(),)
    return (_place(sentence, *quality),)


def _rmc(sentence: Any) -> tuple[Said, ...]:
    if sentence.status != "A" or not sentence.lat:
        return (NoFix(),)
    place = _place(sentence)
    said: list[Said] = [place]
    speed = float(sentence.spd_over_grnd or 0.0) * KNOT_MPS
    velocity = _velocity(speed, sentence.true_course)
    if velocity is not None:
        said.append(Motion(velocity=velocity, second_of_day=place.second_of_day))
    if sentence.mag_variation:
        said.append(Variation(east_rad=_signed(sentence.mag_variation, sentence.mag_var_dir)))
    return tuple(said)


def _vtg(sentence: Any) -> tuple[Said, ...]:
    speed = float(sentence.spd_over_grnd_kts) * KNOT_MPS
    velocity = _velocity(speed, sentence.true_track)
    return () if velocity is None else (Motion(velocity=velocity),)


def _ths(sentence: Any) -> tuple[Said, ...]:
    """Nobody steers by a heading that is estimated, typed in, simulated or void (E, M, S, V)."""
    if sentence.mode != "A":
        return ()
    return (Bow(heading_rad=math.radians(float(sentence.heading)), true=True),)


def _hdg(sentence: Any) -> tuple[Said, ...]:
    heading = math.radians(float(sentence.heading))
    if sentence.deviation:
        heading += _signed(sentence.deviation, sentence.dev_dir)
    bow = Bow(heading_rad=heading, true=False)
    if not sentence.variation:
        return (bow,)
    return Variation(east_rad=_signed(sentence.variation, sentence.var_dir)), bow


def _heading(sentence: Any) -> tuple[Said, ...]:
    true = sentence.sentence_type == "HDT"
    return (Bow(heading_rad=math.radians(float(sentence.heading)), true=true),)


def _rot(sentence: Any) -> tuple[Said, ...]:
    """Degrees a minute, positive to starboard."""
    if sentence.status != "A":
        return ()
    return (Turn(rate_radps=math.radians(float(sentence.rate_of_turn)) / 60),)


def _mtw(sentence: Any) -> tuple[Said, ...]:
    return (Reading(key="temperature_degc", value=float(sentence.temperature)),)


def _dpt(sentence: Any) -> tuple[Said, ...]:
    """Below the transducer; an offset that is positive adds its depth below the surface."""
    below, offset = float(sentence.depth), float(sentence.offset or 0.0)
    return (Reading(key="water_depth_m", value=below + max(offset, 0.0)),)


def _place(sentence: Any, fix: str = "", error_m: float | None = None) -> Place:
    when = sentence.timestamp
    lon, lat = float(sentence.longitude), float(sentence.latitude)
    if abs(lat) > 90 or abs(lon) > 180:
        raise ValueError
    seconds = 3600 * when.hour + 60 * when.minute + when.second + 1e-6 * when.microsecond
    return Place(second_of_day=seconds, lonlat=(lon, lat), fix=fix, error_m=error_m)


def _velocity(speed_mps: float, course_deg: Any) -> tuple[float, float] | None:
    """North and east [m/s]; a boat that hardly moves has no course, and some leave it empty."""
    if course_deg in (None, ""):
        return (0.0, 0.0) if speed_mps < 0.2 else None
    course = math.radians(float(course_deg))
    return speed_mps * math.cos(course), speed_mps * math.sin(course)


def _signed(degrees: Any, side: Any) -> float:
    """Radians, positive to the east."""
    if side not in ("E", "W"):
        raise ValueError
    return math.radians(float(degrees)) * (1 if side == "E" else -1)


def _finite(said: tuple[Said, ...]) -> bool:
    numbers = (
        number
        for one in said
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
