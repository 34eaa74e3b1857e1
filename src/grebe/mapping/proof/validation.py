"""Cross-validation: how good a map is where no sample is near.

Along a track, a sample's neighbours give its value away. So not single samples but whole lines of
the track are left out at a time, or blocks of water if the track has no lines. The nearest sample
and inverse squared distance are judged on the same folds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.spatial import KDTree

from grebe.mapping.methods.base import Field, Readings
from grebe.mapping.scale import LINEAR, Scale
from grebe.mapping.way import blocks_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Indices = NDArray[np.int64]

FEWEST_SAMPLES = 20
# A line ends where the track has turned this far from the line's direction, seen over this
# distance; a shorter line is joined to the next one.
TURN_RAD, SIGHT_M, SHORTEST_LINE = np.pi / 4, 5.0, 8
FEWEST_LINES = 5
BLOCKS_PER_SIDE = 5
# Stretches of the path that are left out: the side of the blocks [m], and the number of turns.
STRETCH_M, STRETCH_TURNS = (12.0, 36.0), 4
# At most this many left-out samples of a turn, evenly spread, are predicted: more show the same.
MOST_JUDGED = 250
IDW_NEIGHBOURS = 12
# An error below this share of the values counts as zero: the water is the same everywhere.
ROUNDING = 1e-12
# A normal distribution has 50 and 95 % of its mass within these standard deviations.
Z50, Z95 = 0.6745, 1.9600


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Predictions of left-out samples at `places` (m, 2): their `error` (m,) and its standard
    deviation `sd` (m,), including the reading's noise, and the values `read` (m,).
    """

    places: Array
    error: Array
    sd: Array
    read: Array

    @property
    def z(self) -> Array:
        """Standardised errors."""
        return np.where(self.error == 0, 0.0, self.error / self.sd)

    @property
    def rmse(self) -> float:
        """Root mean square."""
        return _rms(self.error)


@dataclass(frozen=True, kw_only=True)
class Validation:
    """Errors of left-out samples, in the unit of the quantity.

    `pieces` lines of the track or blocks of water (`left_out`) were left out in `folds` turns.
    `msdr` is the mean squared standardised error (ideally 1). `score` is the mean negative log
    density of the errors, up to a constant, once all standard deviations are scaled to an msdr of
    1. `coverage50` and `coverage95` are the shares of samples within their intervals;
    `nearest_rmse` and `idw_rmse` the errors of the nearest sample and of inverse squared distance.
    """

    left_out: Literal["lines", "blocks", "given"]
    pieces: int
    folds: int
    samples: int
    rmse: float
    bias: float
    msdr: float
    coverage50: float
    coverage95: float
    nearest_rmse: float
    idw_rmse: float
    score: float


def validate(readings: Readings, field: Field, folds: Indices | None = None) -> Validation | None:
    """Leave out each fold in turn, keeping the field's model. Return None if there are too few
    samples, or all are in one fold.
    """
    proof = prove(readings, field, folds)
    return None if proof is None else proof[0]


def prove(
    readings: Readings, field: Field, folds: Indices | None = None, scale: Scale = LINEAR
) -> tuple[Validation, Errors] | None:
    """As `validate`, but also return the errors themselves, on the scale of the readings."""
    left_out: Literal["lines", "blocks", "given"] = "given"
    pieces = 0
    if folds is None:
        folds, left_out, pieces = line_folds(readings.positions)
    count = len(np.unique(folds))
    if len(readings) < FEWEST_SAMPLES or count < 2:
        return None
    errors = predicted(readings, field, folds, most=len(readings))
    if not len(errors.error):
        return None
    simple = _simple_errors(readings, folds, scale)
    in_unit = errors.error
    if scale != LINEAR:
        in_unit = scale.mean(errors.read + errors.error, errors.sd) - scale.back(errors.read)
    msdr = float(np.mean(errors.z**2))
    return Validation(
        left_out=left_out,
        pieces=pieces or count,
        folds=count,
        samples=len(errors.error),
        rmse=_rms(in_unit),
        bias=float(np.mean(in_unit)),
        msdr=msdr,
        coverage50=float(np.mean(np.abs(errors.z) <= Z50)),
        coverage95=float(np.mean(np.abs(errors.z) <= Z95)),
        nearest_rmse=_rms(simple[0]),
        idw_rmse=_rms(simple[1]),
        score=float(np.mean(np.log(errors.sd))) + 0.5 * float(np.log(max(msdr, 1e-300))),
    ), errors


def predicted(readings: Readings, field: Field, folds: Indices, most: int = MOST_JUDGED) -> Errors:
    """Leave out each fold in turn, keeping the field's model, and predict at most `most` of its
    samples. A fold that leaves next to nothing is skipped.
    """
    nothing: Array = np.empty(0)
    errors: list[Array] = [nothing]
    sds: list[Array] = [nothing]
    read: list[Array] = [nothing]
    where: list[Array] = [np.empty((0, 2))]
    for out in _turns(folds):
        rest = field.given(readings.part(~out))
        judged = np.flatnonzero(out)
        judged = judged[:: -(-len(judged) // most)]
        places = readings.positions[judged]
        where.append(places)
        read.append(readings.values[judged])
        errors.append(rest.mean(places) - read[-1])
        sds.append(np.sqrt(rest.sd(places) ** 2 + field.model.nugget))
    error, values = np.concatenate(errors), np.concatenate(read)
    rounding = ROUNDING * float(np.abs(values).max(initial=0.0))
    return Errors(
        places=np.concatenate(where),
        error=np.where(np.abs(error) <= rounding, 0.0, error),
        sd=np.maximum(np.concatenate(sds), np.finfo(float).tiny),
        read=values,
    )


def _turns(folds: Indices) -> list[NDArray[np.bool_]]:
    """The samples of each fold, for the folds that leave enough others."""
    turns = [folds == k for k in np.unique(folds)]
    return [out for out in turns if (~out).sum() >= FEWEST_SAMPLES]


def stretch_folds(positions: Array, side_m: float, seed: int = 0) -> Indices:
    """The turn (n,) in which each sample's block of water is left out."""
    blocks = blocks_of(positions, side_m)
    turn = np.random.default_rng(seed).integers(STRETCH_TURNS, size=int(blocks.max()) + 1)
    return turn[blocks]


def line_folds(positions: Array, seed: int = 0) -> tuple[Indices, Literal["lines", "blocks"], int]:
    """The turn (n,) in which each sample's line is left out, a quarter of the lines at a time;
    whether lines or blocks of water are left out, and how many there are. Blocks are used if the
    track has fewer than `FEWEST_LINES` lines.
    """
    lines = track_lines(positions)
    count = int(lines.max()) + 1 if len(lines) else 0
    if count >= FEWEST_LINES:
        turn = np.random.default_rng(seed).permutation(count) % STRETCH_TURNS
        return turn[lines], "lines", count
    low, extent = positions.min(axis=0), np.ptp(positions, axis=0)
    side = max(float(extent.max()) / BLOCKS_PER_SIDE, 1e-9)
    folds = blocks_of(positions - low, side)
    return folds, "blocks", int(folds.max()) + 1


def track_lines(positions: Array) -> Indices:
    """Number the straight lines of a track, (n,): a new line starts where it turns."""
    lines = np.zeros(len(positions), dtype=np.int64)
    start, line = 0, 0
    heading: float | None = None
    behind = 0
    for i in range(1, len(positions)):
        while behind < i and np.hypot(*(positions[i] - positions[behind + 1])) >= SIGHT_M:
            behind += 1
        way = positions[i] - positions[behind]
        if np.hypot(*way) >= SIGHT_M:
            bearing = float(np.arctan2(way[1], way[0]))
            if heading is None:
                heading = bearing
            elif abs((bearing - heading + np.pi) % (2 * np.pi) - np.pi) > TURN_RAD:
                if i - start >= SHORTEST_LINE:
                    line += 1
                start, heading, behind = i, None, i
        lines[i] = line
    return lines


def _simple_errors(readings: Readings, folds: Indices, scale: Scale) -> Array:
    """Errors (2, m) of the nearest sample and of inverse squared distance, in the unit."""
    positions, values = readings.positions, scale.back(readings.values)
    found = [
        _simple(positions[~out], values[~out], positions[out]) - values[out]
        for out in _turns(folds)
    ]
    return np.concatenate(found, axis=1)


def _simple(positions: Array, values: Array, targets: Array) -> Array:
    """Estimates of the nearest sample and of inverse squared distance, (2, m)."""
    tree = KDTree(positions)
    distance, index = tree.query(targets, k=min(IDW_NEIGHBOURS, len(values)))
    distance, index = np.atleast_2d(distance), np.atleast_2d(index)
    if distance.shape[0] != len(targets):
        distance, index = distance.T, index.T
    weight = 1 / np.maximum(distance, 1e-6) ** 2
    weighted = np.sum(weight * values[index], axis=1) / np.sum(weight, axis=1)
    return np.stack([values[index[:, 0]], weighted])


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))
