"""Boats that keep apart: each claims the water that it may still come to, and no two claims touch.

A claim is the way on which a boat would go on for its reaction time and then stop, foreseen as the
fence foresees it. A boat takes a new claim only where that is farther than the stated distance from
the claims that the others hold at that moment, and keeps the way of its old one otherwise: it
stops. Claims are taken one after the other, so at every instant each boat is on a claim of its own
and the claims are apart, whatever the boats intend. Planning with what the others have announced,
and a stop that is always at hand, is how distributed predictive control keeps what it promises
(Schouwenaars, How and Feron 2004, AIAA GNC, "Decentralized cooperative trajectory planning of
multiple aircraft with hard safety guarantees").

Who may go first is decided beforehand, by the boats' numbers: a boat also says where it wishes to
go, and one of a higher number that lies in the way makes room.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A boat that holds its place wanders about it by so much, and estimates are off [m].
WANDER_M = 1.0
# A claim's way is rounded to this [m].
ROUNDING_M = 0.05


@dataclass
class Traffic:
    """What the boats of one fleet claim and wish, by their numbers; safe from any thread.

    `apart_m` is the distance between two boats' centres that is kept.
    """

    apart_m: float
    _claims: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _wishes: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def nearest_m(self, boat: int, place: tuple[float, float]) -> float:
        """How far the nearest claim of another is; infinite where there is none."""
        return _away_m(shapely.Point(place), self._of_others(boat))

    def taken(self, boat: int) -> BaseGeometry:
        """The water that others' claims keep this boat's centre out of."""
        return _around(self._of_others(boat), self.apart_m + 2 * WANDER_M)

    def wished(self, boat: int, *, by_all: bool = False) -> BaseGeometry:
        """The water that boats of lower numbers wish to cross, or all others."""
        with self._lock:
            wishes = [
                wish
                for other, wish in self._wishes.items()
                if other < boat or (by_all and other != boat)
            ]
        return _around(wishes, self.apart_m + 3 * WANDER_M)

    def claim(self, boat: int, way: NDArray[np.float64]) -> bool:
        """Take the way (n, 2) as this boat's claim; False where it is too near to another's."""
        line = _line(way)
        with self._lock:
            if _away_m(line, self._of_others(boat)) < self.apart_m + WANDER_M:
                return False
            self._claims[boat] = line
            return True

    def wish(self, boat: int, way: NDArray[np.float64] | None, room_m: float = 0.0) -> None:
        """Say where this boat would go, with what it needs beside it; None for nowhere."""
        with self._lock:
            if way is None:
                self._wishes.pop(boat, None)
            else:
                self._wishes[boat] = (
                    _line(way).buffer(room_m, quad_segs=4) if room_m else _line(way)
                )

    def leave(self, boat: int) -> None:
        """A boat that is over wishes nothing any more; it keeps its claim, for it lies there."""
        self.wish(boat, None)

    def _of_others(self, boat: int) -> list[BaseGeometry]:
        with self._lock:
            return [claim for other, claim in self._claims.items() if other != boat]


def _line(way: NDArray[np.float64]) -> BaseGeometry:
    if np.ptp(way, axis=0).max() < ROUNDING_M:
        return shapely.Point(way[0])
    return shapely.LineString(way).simplify(ROUNDING_M)


def _away_m(shape: BaseGeometry, others: list[BaseGeometry]) -> float:
    """The distance to the nearest of some shapes; infinite without any."""
    return min((shape.distance(other) for other in others), default=math.inf)


def _around(shapes: list[BaseGeometry], distance_m: float) -> BaseGeometry:
    if not shapes:
        return shapely.Polygon()
    return shapely.union_all([shape.buffer(distance_m, quad_segs=4) for shape in shapes])
