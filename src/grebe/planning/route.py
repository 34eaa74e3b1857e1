"""Put the cells in order: the ordered sequence Omega_1 ... Omega_K of remark 12."""

from __future__ import annotations

import itertools
from collections import defaultdict

import numpy as np

from grebe.planning.mesh import Cell


def boustrophedon(cells: list[Cell], start: tuple[float, float]) -> list[Cell]:
    """Order cells row by row, there and back, beginning at the corner nearest the start.

    Rows or columns, from either end, first there or first back: of these eight sweeps the
    one whose way from `start` (north, east) [m] through all centres is shortest, among
    those that begin within half a cell of the nearest corner.
    """
    sweeps = [
        _sweep(cells, by_column=by_column, rows_reversed=rows, first_reversed=first)
        for by_column, rows, first in itertools.product((False, True), repeat=3)
    ]
    leads = [_distance(start, _centre(sweep[0])) for sweep in sweeps]
    half_cell = 0.5 * np.sqrt(np.median([cell.footprint.area for cell in cells]))
    near = [s for s, lead in zip(sweeps, leads, strict=True) if lead <= min(leads) + half_cell]
    return min(near, key=lambda sweep: _length(start, sweep))


def _sweep(
    cells: list[Cell], *, by_column: bool, rows_reversed: bool, first_reversed: bool
) -> list[Cell]:
    lanes: dict[int, list[Cell]] = defaultdict(list)
    for cell in cells:
        lanes[cell.column if by_column else cell.row].append(cell)
    order: list[Cell] = []
    for i, lane in enumerate(sorted(lanes, reverse=rows_reversed)):
        backwards = (i % 2 == 1) != first_reversed
        order += sorted(
            lanes[lane],
            key=lambda cell: cell.row if by_column else cell.column,
            reverse=backwards,
        )
    return order


def _centre(cell: Cell) -> tuple[float, float]:
    point = cell.footprint.centroid
    return point.x, point.y


def _distance(a: tuple[float, float], b: tuple[float, float]) -> float:
    return float(np.hypot(b[0] - a[0], b[1] - a[1]))


def _length(start: tuple[float, float], sweep: list[Cell]) -> float:
    points = np.array([start, *map(_centre, sweep)])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
