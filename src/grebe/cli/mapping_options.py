"""The mapping options, shared by every command that makes maps."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from grebe.cli import options
from grebe.core.errors import UsageError
from grebe.core.survey import Survey
from grebe.io.readers.depth import read_depth
from grebe.mapping.covariance.drift import DriftFunction, combined, inflow, linear
from grebe.mapping.covariance.variogram import ESTIMATORS
from grebe.mapping.maps import MapSettings
from grebe.mapping.methods.choice import (
    AVERAGED,
    COVARIANCE_FITS,
    KRIGING,
    METHODS,
    ByShore,
    Straight,
    with_settings,
)
from grebe.mapping.scale import SCALES


def _keys(
    _ctx: click.Context, _param: click.Parameter, value: str | tuple[str, ...] | None
) -> tuple[str, ...]:
    if isinstance(value, tuple):
        return value
    return tuple(one.strip() for one in (value or "").split(",") if one.strip())


mapping_options = options.together(
    click.option(
        "--resolution", "resolution_m", type=float, help="Spacing of the map's nodes [m]."
    ),
    click.option(
        "--method",
        type=click.Choice(tuple(METHODS)),
        help="Interpolation method.  [default: spde where land comes between the readings and the "
        "map, else kriging]",
    ),
    click.option(
        "--variogram",
        type=click.Choice(tuple(COVARIANCE_FITS)),
        help="Fit one covariance that depends on place only: rough or smooth by its posterior "
        "under priors, reml by restricted likelihood alone, wls by the variogram.  [default: the "
        "mean of two maps, by a rough covariance and by a smooth one that allows for differences "
        "between passes]",
    ),
    click.option(
        "--moment",
        type=options.MOMENT,
        help="Map the water at one time of the survey (ISO 8601, or middle): changes that all the "
        "water shares, and sensor lags, are estimated and removed.  [default: each place as it was "
        "measured]",
    ),
    click.option(
        "--every",
        "every_s",
        type=options.Minutes(),
        help="Also make a movie, with one map for every MINUTES of the survey. The other maps then "
        "show its middle, or --moment.",
    ),
    click.option(
        "--together",
        metavar="KEY,KEY...",
        callback=_keys,
        help="Map these quantities together (cokriging): one with few readings also uses the many "
        "readings of another that varies with it.",
    ),
    click.option(
        "--scale",
        type=click.Choice(tuple(SCALES)),
        help="Map the quantity itself, or its logarithm with asymmetric intervals.  [default: the "
        "logarithm if the values are positive and skewed]",
    ),
    click.option(
        "--drift", type=click.Choice(("linear",)), help="Let the mean be a plane across the lake."
    ),
    click.option(
        "--inflow",
        "inflows",
        type=options.LON_LAT,
        multiple=True,
        help="Let the mean depend on the distance to this inflow; may be repeated.",
    ),
    click.option(
        "--depth",
        type=options.EXISTING,
        help="Let the mean depend on the depth, from this raster (GeoTIFF).",
    ),
    click.option(
        "--shore-depth-sd",
        "shore_depth_sd_m",
        type=float,
        help="For the map of water depth: take the depth along the shore as zero, with this "
        "standard deviation [m].",
    ),
    click.option(
        "--estimator",
        type=click.Choice(ESTIMATORS),
        default="matheron",
        show_default=True,
        help="Estimator of the variogram; cressie and dowd are robust to outliers.",
    ),
)
# The options that the next command repeats, by the names of their values.
REPEATED = {
    "resolution_m": "--resolution",
    "method": "--method",
    "variogram": "--variogram",
    "moment": "--moment",
    "every_s": "--every",
    "together": "--together",
    "scale": "--scale",
    "drift": "--drift",
    "inflows": "--inflow",
    "depth": "--depth",
    "shore_depth_sd_m": "--shore-depth-sd",
    "estimator": "--estimator",
}


def map_settings(asked: dict[str, Any], survey: Survey) -> MapSettings:
    """The settings with which the options map a survey."""
    drift = _drift(survey, asked["drift"], asked["inflows"], asked["depth"])
    return settings_with(asked, drift)


def asked_again(ctx: click.Context) -> str:
    """The options that were typed, as text for the next command."""
    words: list[str] = []
    for name, flag in REPEATED.items():
        if ctx.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        value = ctx.params[name]
        for one in value if name == "inflows" else [value]:
            words += [flag, shlex.quote(_as_written(name, one))]
    return "".join(f" {word}" for word in words)


def _as_written(name: str, value: Any) -> str:
    if name == "moment" and isinstance(value, float):
        return datetime.fromtimestamp(value, UTC).isoformat().replace("+00:00", "Z")
    if name == "every_s":
        return f"{value / 60:g}"
    if name == "together":
        return ",".join(value)
    if name == "inflows":
        return ",".join(f"{one:.10g}" for one in value)
    return str(value)


def settings_with(asked: dict[str, Any], drift: DriftFunction | None) -> MapSettings:
    """The settings given by the options, with a `drift` that is read already."""
    _refuse_beside_together(asked)
    method, variogram = asked["method"], asked["variogram"]
    more: dict[str, Any] = {
        "shore_depth_sd_m": asked["shore_depth_sd_m"],
        "moment": asked["moment"],
        "together": asked["together"],
        "scale": SCALES.get(asked["scale"]),
    }
    given = {"estimator": asked["estimator"], "drift": drift}
    if variogram is not None:
        given["fit_covariance"] = COVARIANCE_FITS[variogram]
    if method not in (None, AVERAGED.key):
        return MapSettings(method=with_settings(METHODS[method], **given), **more)
    straight: tuple[Straight, ...] = (AVERAGED,) if variogram is None else KRIGING[:1]
    straight = with_settings(straight, **given)
    if method is None:
        return MapSettings(choice=ByShore(straight=straight), **more)
    return MapSettings(method=straight, **more)


def _refuse_beside_together(asked: dict[str, Any]) -> None:
    """Raise `UsageError` for options that cokriging would ignore, because it has one mean for all
    places and covariances of its own.
    """
    if not asked["together"]:
        return
    given = {
        f"--method {asked['method']}": asked["method"] not in (None, AVERAGED.key),
        "--variogram": asked["variogram"] is not None,
        "--drift": asked["drift"] is not None,
        "--inflow": bool(asked["inflows"]),
        "--depth": asked["depth"] is not None,
        "--estimator": asked["estimator"] != ESTIMATORS[0],
    }
    for flag, is_given in given.items():
        if is_given:
            raise UsageError(
                f"--together is cokriging, with one mean for all places and covariances of its "
                f"own: it ignores {flag}; leave that out, or map without --together."
            )


def _drift(
    survey: Survey,
    name: str | None,
    inflows: Sequence[tuple[float, float]],
    depth: Path | None,
) -> DriftFunction | None:
    frame = survey.frame
    functions: list[DriftFunction] = [linear] if name == "linear" else []
    functions += [inflow(frame.place_near(survey.water, place, "inflow")) for place in inflows]
    if depth is not None:
        functions.append(read_depth(depth, frame))
    return combined(functions)
