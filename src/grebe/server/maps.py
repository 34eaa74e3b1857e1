"""Maps for the page, made in a process of their own and cached while their survey is unchanged.

The map of a survey under way takes in the readings since its last request. It is fitted anew only
when the number of readings has grown by half.
"""

from __future__ import annotations

import base64
import importlib
import math
from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.frames import LocalFrame
from grebe.core.polyline import passed_m, places_at
from grebe.core.quantity import Quantity
from grebe.core.samples import Flag
from grebe.io.store import SurveyFile
from grebe.mapping.fields.joining import distinct
from grebe.mapping.fields.sequential import SequentialField, sequential
from grebe.mapping.grid import make_grid
from grebe.mapping.lag import corrected_values
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.base import Readings
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.scale import LINEAR
from grebe.mapping.threads import one_blas_thread
from grebe.server.failures import NoMapError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Approximate number of nodes of a map that is still forming; a finished one has the default.
FORMING_NODES = 2_500
# A forming map is fitted anew when its readings reach this multiple of those of its fit.
FIT_AGAIN = 1.5
KEPT, FORMING_KEPT = 24, 8
PROFILE_POINTS = 200


@dataclass(frozen=True, kw_only=True)
class Made:
    """A map, its local frame, and the positions (n, 2) and flags (n,) of its samples."""

    map: QuantityMap
    frame: LocalFrame
    positions: NDArray[np.float64]
    flags: NDArray[np.int64]


@dataclass(kw_only=True)
class Forming:
    """A map that takes in readings: `fitted` is the map at its fit, from the first `rows` of the
    file; `taken` rows are in it now.
    """

    fitted: QuantityMap
    field: SequentialField
    readings: Readings
    rows: int
    taken: int

    def holds(self, count: int) -> bool:
        """Whether a file of `count` rows extends the rows taken in, without needing a new fit."""
        return self.taken <= count < FIT_AGAIN * self.rows

    def take_in(
        self, positions: NDArray[np.float64], values: NDArray[Any], flags: NDArray[np.int64]
    ) -> None:
        """Take in the new rows."""
        new = slice(self.taken, None)
        good = np.isfinite(values[new]) & np.isin(flags[new], Flag.USABLE)
        at, read = positions[new][good], values[new][good]
        once = distinct(at, read)
        at, read = at[once], read[once]
        with one_blas_thread():
            self.field.add(at, read)
        self.taken = len(values)
        self.readings = Readings(
            positions=np.vstack([self.readings.positions, at]),
            values=np.append(self.readings.values, read),
        )

    def now(self) -> QuantityMap:
        """The map of all readings taken in."""
        one, nodes = self.fitted, self.fitted.grid.nodes
        factors = replace(one.calibration, way=self.readings.positions)
        sd = np.hypot(factors.factor(nodes) * self.field.node_sd, one.micro_sd)
        return replace(
            one,
            mean=one.grid.spread(self.field.node_mean),
            sd=one.grid.spread(sd),
            calibration=factors,
            field=self.field,
            readings=self.readings,
        )


_KEPT: OrderedDict[tuple[Any, ...], Made] = OrderedDict()
_FORMING: OrderedDict[tuple[str, str], Forming] = OrderedDict()


def _made(path: str, quantity: str, *, forming: bool) -> Made:
    """The map of a quantity, updated if the file has changed."""
    key = (path, quantity, forming, *_stamps(path))
    if key in _KEPT:
        _KEPT.move_to_end(key)
        return _KEPT[key]
    with SurveyFile.open(Path(path)) as file:
        survey, samples = file.survey, file.samples()
        if quantity not in samples.values:
            raise NoMapError(f"This survey has no quantity {quantity!r}.")
        known = file.quantities.known(quantity)
        values = corrected_values(samples, file.lags())[quantity]
    flags = samples.flags[quantity]
    taken = (known, samples.positions, values, flags)
    if forming:
        one = _forming(path, survey.water, *taken)
    else:
        one = Mapper(survey.water, make_grid(survey.water)).map_quantity(*taken)
    made = Made(map=one, frame=survey.frame, positions=samples.positions, flags=flags)
    _KEPT[key] = made
    while len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return made


def _forming(
    path: str,
    water: shapely.Polygon,
    quantity: Quantity,
    positions: NDArray[np.float64],
    values: NDArray[Any],
    flags: NDArray[np.int64],
) -> QuantityMap:
    """The map of a survey under way, with new readings taken in or fitted anew."""
    key = (path, quantity.key)
    kept = _FORMING.get(key)
    if kept is not None and kept.holds(len(values)):
        kept.take_in(positions, values, flags)
        return kept.now()
    grid = make_grid(water, math.sqrt(water.area / FORMING_NODES))
    settings = MapSettings(scale=LINEAR)
    fitted = Mapper(water, grid, settings).map_quantity(quantity, positions, values, flags)
    with one_blas_thread():
        begun = sequential(fitted.field, grid.nodes)
    if begun is None:
        return fitted
    rows = len(values)
    _FORMING[key] = Forming(
        fitted=fitted, field=begun, readings=fitted.readings, rows=rows, taken=rows
    )
    while len(_FORMING) > FORMING_KEPT:
        _FORMING.popitem(last=False)
    return fitted


def _stamps(path: str) -> tuple[float, ...]:
    found: list[float] = []
    for name in (path, f"{path}-wal"):
        try:
            found.append(Path(name).stat().st_mtime)
        except OSError:
            found.append(0.0)
    return tuple(found)


def grid(
    path: str, quantity: str, layer: str, threshold: float | None, side: str, *, forming: bool
) -> dict[str, Any]:
    """A layer of a map, in the form that the page paints."""
    made = _made(path, quantity, forming=forming)
    one = made.map
    unit = one.quantity.unit
    span: list[float] | None = None
    if layer == "mean":
        field = one.mean
    elif layer == "sd":
        field = one.sd
        span = [0.0, float(np.nanmax(field))]
    elif layer == "probability":
        if threshold is None:
            raise InputError("A probability needs a threshold.", settings=("threshold",))
        above = one.exceedance(threshold)
        field, unit, span = (1 - above if side == "below" else above), "", [0.0, 1.0]
    elif layer == "quality":
        field, unit, span = _quality(made), "", [0.0, 1.0]
    else:
        raise InputError(f"A map has no layer {layer!r}.", settings=("layer",))
    note = "The boat is under way: this map is still forming." if forming else None
    return _grid(made, field, layer, unit, span, note)


def _quality(made: Made) -> NDArray[np.floating]:
    """The share of good values among the sixteen nearest samples, at each node."""
    from scipy.spatial import KDTree

    one = made.map
    good = np.isin(made.flags, Flag.USABLE).astype(float)
    there = made.flags != Flag.MISSING
    if not there.any():
        return np.full(one.mean.shape, np.nan)
    tree = KDTree(made.positions[there])
    count = min(16, int(there.sum()))
    _, nearest = tree.query(one.grid.nodes, k=count)
    share = good[there][np.asarray(nearest).reshape(len(one.grid.nodes), count)].mean(axis=1)
    return one.grid.spread(share)


def _grid(
    made: Made,
    field: NDArray[np.floating],
    layer: str,
    unit: str,
    span: list[float] | None,
    note: str | None,
) -> dict[str, Any]:
    one = made.map
    lay = one.grid
    half = lay.step_m / 2
    south, north = lay.north[0] - half, lay.north[-1] + half
    west, east = lay.east[0] - half, lay.east[-1] + half
    corners = made.frame.to_wgs84([(south, west), (south, east), (north, east), (north, west)])
    if span is None:
        low, high = float(np.nanmin(field)), float(np.nanmax(field))
        span = [low, high if high > low else low + 1e-6]
    values = np.ascontiguousarray(field, dtype="<f4")
    return {
        "quantity": one.quantity.key,
        "layer": layer,
        "nx": values.shape[1],
        "ny": values.shape[0],
        "corners": np.round(corners, 8).tolist(),
        "values": base64.b64encode(values.tobytes()).decode("ascii"),
        "range": span,
        "levels": [],
        "unit": unit,
        "version": one.samples,
        "method": one.method.label,
        "samples": one.samples,
        "note": note,
    }


def _inside(made: Made, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    lay = made.map.grid
    row = np.rint((places[:, 0] - lay.north[0]) / lay.step_m).astype(int)
    column = np.rint((places[:, 1] - lay.east[0]) / lay.step_m).astype(int)
    known = (row >= 0) & (row < len(lay.north)) & (column >= 0) & (column < len(lay.east))
    found = np.zeros(len(places), dtype=bool)
    found[known] = lay.inside[row[known], column[known]]
    return found


def at(path: str, quantity: str, lon: float, lat: float, *, forming: bool) -> dict[str, Any]:
    """The value at a place, with its 95 % interval."""
    made = _made(path, quantity, forming=forming)
    place = made.frame.to_local([(lon, lat)])
    if not np.isfinite(place).all() or not _inside(made, place)[0]:
        raise NoMapError("This survey has no water at that place.")
    found = made.map.at(place)
    return {
        "mean": float(found.mean[0]),
        "sd": float(found.sd[0]),
        "low": float(found.low[0]),
        "high": float(found.high[0]),
        "unit": made.map.quantity.unit,
    }


def profile(
    path: str, quantity: str, line: list[tuple[float, float]], *, forming: bool
) -> dict[str, Any]:
    """Values along a line, with their 95 % interval; None off the water."""
    made = _made(path, quantity, forming=forming)
    corners = made.frame.to_local(line)
    length_m = float(passed_m(corners)[-1])
    if not 0 < length_m < 1e6:
        raise InputError("The line has no length, or is too long.", settings=("line",))
    distance = np.linspace(0.0, length_m, PROFILE_POINTS)
    places = places_at(corners, distance)
    inside = _inside(made, places)
    found, nothing = (made.map.at(places[inside]) if inside.any() else None), np.zeros(0)

    def column(values: NDArray[np.floating]) -> list[float | None]:
        every = np.full(len(places), np.nan)
        every[inside] = values
        return [None if math.isnan(value) else float(value) for value in every]

    return {
        "distance_m": np.round(distance, 2).tolist(),
        "mean": column(found.mean if found else nothing),
        "low": column(found.low if found else nothing),
        "high": column(found.high if found else nothing),
        "unit": made.map.quantity.unit,
    }


def difference(path: str, other: str, quantity: str) -> dict[str, Any]:
    """This survey minus another one, where both have water."""
    from grebe.workflow.differences import compare_surveys

    changes = compare_surveys(Path(other), Path(path))
    change = changes.by_quantity.get(quantity)
    if change is None:
        raise NoMapError(f"The two surveys have no map of {quantity!r} in common.")
    made = Made(
        map=change.before,
        frame=changes.survey.frame,
        positions=np.zeros((0, 2)),
        flags=np.zeros(0, dtype=np.int64),
    )
    found = change.difference.mean
    return _grid(made, found, "difference", change.before.quantity.unit, None, None)


def warm() -> None:
    """Import the modules that maps need, before the first map is requested."""
    for name in ("scipy.spatial", "grebe.mapping.methods.choice", "grebe.report.data"):
        importlib.import_module(name)


def report(path: str, language: str) -> None:
    """Write the report of a survey beside its file."""
    from grebe.report.data import gather
    from grebe.report.page import write_report

    survey = Path(path)
    with SurveyFile.open(survey) as file:
        data = gather(file)
    write_report(survey.with_suffix(".html"), data, None, language)
