"""Identification of a boat from a drive: fit, test on held-out pieces, refit, standard errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError, UsageError
from grebe.core.vessel import Vessel
from grebe.identification.drive_log import DriveLog
from grebe.identification.estimator import Descent, Fit
from grebe.identification.open_loop import course_of, tried
from grebe.identification.parameters import Candidate, Model, model_of
from grebe.identification.result import DETERMINED_SHARE, FittedValue, Identification
from grebe.identification.segments import Segments, segments_of
from grebe.identification.uncertainty import covariance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Every fourth piece is held out.
HELD_OUT_EVERY = 4
# Longer logs are thinned evenly to this many pieces.
MOST_PIECES = 240
# A drag that the preset lacks is kept if it exceeds this many standard errors.
BELIEVED_SD = 3.0
# A thruster that is stronger than the other by this share is reported.
UNEVEN = 0.03


@dataclass(frozen=True, kw_only=True)
class IdentifySettings:
    """Settings of an identification.

    `piece_s`: time for which each piece is predicted. `bollard_n`: measured pull of one thruster at
    full command ahead, by default the preset's `thrust_max_n`.
    """

    piece_s: float = 10.0
    bollard_n: float | None = None

    def __post_init__(self) -> None:
        if not 5.0 <= self.piece_s <= 60.0:
            raise UsageError(
                f"Pieces of {self.piece_s:g} s are impossible; give 5 to 60 s.",
                settings=("piece_s",),
            )
        if self.bollard_n is not None and not 0 < self.bollard_n < math.inf:
            raise UsageError(
                f"A pull of {self.bollard_n:g} N is impossible; give that of one thruster at "
                "full command ahead.",
                settings=("bollard_n",),
            )


DEFAULT = IdentifySettings()


def identify(log: DriveLog, preset: Vessel, settings: IdentifySettings = DEFAULT) -> Identification:
    """Estimate a boat's parameters from a drive.

    A parameter that the drive does not determine stays at the preset's value, and a note names it.
    Commands in newtons are converted to throttles by the preset's curve. Raises `InputError` for a
    log without information.
    """
    log = log.in_throttles(preset)
    base = _pulling(preset, settings.bollard_n)
    pieces = _at_most(segments_of(log, settings.piece_s))
    held = pieces.used % HELD_OUT_EVERY == HELD_OUT_EVERY - 1
    if held.all() or not held.any():
        held = np.arange(len(pieces.used)) == len(pieces.used) - 1
    model = model_of(base)
    blind = _fit(log, pieces.choose(~held), model)
    fit = Descent(log, pieces, blind.model).run(blind.theta, blind)
    if not math.isfinite(fit.cost):
        raise InputError(f"{log.name}: no boat moves as this log says; check its units.")
    spread = covariance(fit, pieces)
    hold_out = tried(log, pieces, held, blind, _as_believed(base, blind))
    return Identification(
        vessel=_vessel(fit, log.name),
        latency_s=fit.model.values(fit.theta)["latency_s"],
        parameters=_parameters(fit, spread),
        derived=_derived(fit, spread, log),
        noise=fit.noise,
        hold_out=hold_out,
        course=course_of(log, pieces, held, blind),
        notes=_notes(fit, spread, settings),
    )


def _pulling(preset: Vessel, bollard_n: float | None) -> Vessel:
    """The preset with another thrust, scaled astern in proportion."""
    if bollard_n is None:
        return preset
    factor = bollard_n / preset.thrust_max_n
    return replace(
        preset,
        thrust_max_n=bollard_n,
        thrust_min_n=preset.thrust_min_n * factor,
        thruster_dead_band_n=preset.thruster_dead_band_n * factor,
    )


def _at_most(pieces: Segments) -> Segments:
    count = len(pieces.used)
    if count <= MOST_PIECES:
        return pieces
    keep = np.zeros(count, dtype=bool)
    keep[np.linspace(0, count - 1, MOST_PIECES).astype(int)] = True
    return pieces.choose(keep)


def _fit(log: DriveLog, pieces: Segments, model: Model) -> Fit:
    """Fit, and add those drags missing from the preset that the log shows."""
    first = Descent(log, pieces, model).run()
    wide = first.model.with_missing_drags()
    if len(wide.parameters) == len(model.parameters):
        return first
    start = np.concatenate([first.theta, np.zeros(len(wide.parameters) - len(first.theta))])
    tried_out = Descent(log, pieces, wide).run(start, first)
    sd = np.sqrt(np.diag(covariance(tried_out, pieces)))
    missing = range(len(first.theta), len(wide.parameters))
    idle = [wide.names[i] for i in missing if tried_out.theta[i] < BELIEVED_SD * sd[i]]
    if len(idle) == len(missing):
        return first
    chosen = wide.without(idle)
    keep = [name not in idle for name in wide.names]
    return Descent(log, pieces, chosen).run(tried_out.theta[keep], tried_out)


def _as_believed(preset: Vessel, fit: Fit) -> Candidate:
    """The preset's boat on the fitted day, which a plan would have assumed."""
    known = fit.model.candidate(fit.theta)
    thrusters = replace(
        known.thrusters,
        full_ahead_n=preset.thrust_max_n,
        full_astern_n=-preset.thrust_min_n,
        exponent=preset.throttle_exponent,
        lag_s=preset.thruster_lag_s,
        latency_s=0.0,
        trim=0.0,
    )
    return replace(known, vessel=preset, thrusters=thrusters)


def _vessel(fit: Fit, name: str) -> Vessel:
    boat = fit.model.candidate(fit.theta).vessel
    return replace(boat, source=f"Identified from {name}, beginning from {boat.name}.")


def _parameters(fit: Fit, spread: Array) -> tuple[FittedValue, ...]:
    sd = np.sqrt(np.diag(spread))
    out: list[FittedValue] = []
    for one, theta, error in zip(fit.model.parameters, fit.theta, sd, strict=True):
        value = one.value(float(theta))
        own = float(error) * (value if one.log else 1.0)
        # A lag of zero counts as determined just as one of a second does.
        is_determined = float(error) < DETERMINED_SHARE * (1.0 if one.log else one.prior_sd)
        out.append(
            FittedValue(
                name=one.name,
                unit=one.unit,
                value=value,
                sd=own,
                before=fit.model.before(one.name),
                is_determined=is_determined,
                of_the_day=one.of_the_day,
            )
        )
    return tuple(out)


def _derived(fit: Fit, spread: Array, log: DriveLog) -> tuple[FittedValue, ...]:
    """Drags at the velocities of the log, and the top speed, which depend on pairs of drags."""
    moving = np.abs(log.states[:, 3:])
    usual = [
        float(np.nanpercentile(one, 90)) if np.isfinite(one).any() else 0.5 for one in moving.T
    ]

    def top_speed(boat: Vessel) -> float:
        return boat.speed_max_mps

    kinds: list[tuple[str, str, Callable[[Vessel], float]]] = [
        (f"surge drag at {usual[0]:.2g} m/s", "N", lambda b: b.surge_drag_n(usual[0])),
        (
            f"sway drag at {usual[1]:.2g} m/s", "N",
            lambda b: -(b.y_v + b.y_vv * usual[1]) * usual[1],
        ),
        (
            f"yaw drag at {math.degrees(usual[2]):.2g} deg/s", "N m",
            lambda b: -(b.n_r + b.n_rr * usual[2]) * usual[2],
        ),
        ("top speed", "m/s", top_speed),
    ]  # fmt: skip
    return tuple(_delta(fit, spread, *kind) for kind in kinds)


def _delta(
    fit: Fit, spread: Array, name: str, unit: str, number: Callable[[Vessel], float]
) -> FittedValue:
    """A function of the boat's parameters with its standard error, by the delta method."""

    def of(theta: Array) -> float:
        return number(fit.model.candidate(theta).vessel)

    value = of(fit.theta)
    probe = 1e-5 * np.eye(len(fit.theta))
    slope = np.array([(of(fit.theta + one) - value) / 1e-5 for one in probe])
    sd = float(np.sqrt(slope @ spread @ slope))
    return FittedValue(
        name=name, unit=unit, value=value, sd=sd, before=number(fit.model.base),
        is_determined=sd < DETERMINED_SHARE * abs(value),
    )  # fmt: skip


def _notes(fit: Fit, spread: Array, settings: IdentifySettings) -> tuple[str, ...]:
    boat = fit.model.candidate(fit.theta).vessel
    whence = "as measured" if settings.bollard_n else "from the preset"
    notes = [
        "motion alone determines masses, drags and thrusts only up to a common factor: it "
        f"is set by {boat.thrust_max_n:g} N of one thruster at full command ahead "
        f"({whence}); in yaw by the arm of {fit.model.base.arm_m:g} m, measured by tape, and by "
        "the boat's sway"
    ]
    told = _parameters(fit, spread)
    vague = [one.name for one in told if not one.is_determined and not one.of_the_day]
    if vague:
        notes.append(
            f"this drive does not determine {', '.join(vague)}: the preset's values are kept"
        )
    trim = next(one for one in told if one.name == "trim")
    if abs(trim.value) > max(UNEVEN, 2 * trim.sd):
        side = "port" if trim.value > 0 else "starboard"
        notes.append(
            f"the {side} thruster gives {100 * (math.exp(abs(trim.value)) - 1):.0f} % more than "
            "the other at the same command; a vessel file has one curve for both"
        )
    compass = next(one for one in told if one.name == "compass_rad")
    if abs(compass.value) > max(math.radians(2), 2 * compass.sd):
        notes.append(
            f"the compass is off by {math.degrees(compass.value):+.1f} deg relative to the "
            "course over ground"
        )
    return tuple(notes)
