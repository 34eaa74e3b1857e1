"""Checks of an autopilot before a survey: its place, clock, parameters and guards.

Parameters are read, never written.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import shapely

from grebe.core.errors import LinkError
from grebe.core.survey import Survey
from grebe.links.base import Observation
from grebe.links.checks import Check, Verdict, check
from grebe.links.mavlink.dialects import Need
from grebe.links.mavlink.link import MavlinkLink

LOOK_S = 3.0
SLOWEST_RATE_HZ = 4.0
LATEST_S = 0.5
FEWEST_SATELLITES = 8
LOW_BATTERY = 0.5
FAR_FROM_START_M = 100.0


def preflight(link: MavlinkLink, survey: Survey | None) -> Iterator[Check]:
    """Yield the lines of the list, each as soon as it has been checked.

    Without a survey the checks of its water and its speeds are left out.
    """
    vehicle = link.station.vehicle
    yield check(
        "autopilot", f"{vehicle.dialect.name}, system {vehicle.system}, {vehicle.mode_name}",
        holds=True,
    )  # fmt: skip
    try:
        seen = _look(link)
    except LinkError as error:
        yield check("estimates", str(error), holds=False, advice="check the line to the autopilot")
        return
    yield from _stream_checks(link, seen)
    yield from _place_checks(link, seen[-1], survey)
    yield _battery(link)
    yield from _parameter_checks(link, survey)


def _look(link: MavlinkLink) -> list[Observation]:
    seen = [link.observe()]
    while seen[-1].time_s - seen[0].time_s < LOOK_S:
        seen.append(link.observe())
    return seen


def _stream_checks(link: MavlinkLink, seen: list[Observation]) -> Iterator[Check]:
    rate_hz = (len(seen) - 1) / (seen[-1].time_s - seen[0].time_s)
    yield check(
        "estimates", f"{rate_hz:.1f} a second", holds=rate_hz >= SLOWEST_RATE_HZ,
        advice="raise the rate of LOCAL_POSITION_NED and ATTITUDE, or use a faster line",
    )  # fmt: skip
    age_s = max(one.age_s for one in seen)
    yield check(
        "age of an estimate", f"{age_s:.2f} s at most", holds=age_s <= LATEST_S,
        advice="estimates come late: use a wire, or a radio with less delay",
        otherwise=Verdict.DOUBTFUL,
    )  # fmt: skip
    delay_s = link.station.clock.delay_s
    known = not math.isnan(delay_s)
    yield check(
        "clocks", f"matched, {1e3 * delay_s:.0f} ms one way" if known else "not matched",
        holds=known, advice="the autopilot does not answer TIMESYNC, so its delay is unknown",
        otherwise=Verdict.DOUBTFUL,
    )  # fmt: skip


def _place_checks(link: MavlinkLink, last: Observation, survey: Survey | None) -> Iterator[Check]:
    vehicle = link.station.vehicle
    good = vehicle.position_good is not False and all(map(math.isfinite, last.state))
    yield check(
        "position", vehicle.fix_name or "no report from the receiver",
        holds=good and vehicle.satellites >= FEWEST_SATELLITES,
        advice="wait under an open sky until the filter has settled (nearly a minute)",
        otherwise=Verdict.DOUBTFUL if good else Verdict.BAD,
    )  # fmt: skip
    if not good or survey is None:
        return
    here = shapely.Point(last.state[0], last.state[1])
    away_m = float(survey.water.distance(here))
    yield check(
        "place", "within the survey's water" if away_m == 0 else f"{away_m:.0f} m outside it",
        holds=away_m == 0, advice="bring the boat onto this survey's water",
    )  # fmt: skip
    if survey.start is not None:
        to_start_m = here.distance(shapely.Point(survey.start.north_m, survey.start.east_m))
        yield check(
            "start", f"{to_start_m:.0f} m away", holds=to_start_m <= FAR_FROM_START_M,
            advice="bring the boat nearer to the planned start, or plan from where it is",
            otherwise=Verdict.DOUBTFUL,
        )  # fmt: skip


def _battery(link: MavlinkLink) -> Check:
    share = link.station.vehicle.battery_share
    return check(
        "battery", "not reported" if share is None else f"{share:.0%}",
        holds=share is not None and share >= LOW_BATTERY,
        advice="charge the battery, or set up the autopilot's battery monitor",
        otherwise=Verdict.DOUBTFUL,
    )  # fmt: skip


def _parameter_checks(link: MavlinkLink, survey: Survey | None) -> Iterator[Check]:
    vehicle = link.station.vehicle
    dialect = vehicle.dialect
    if dialect.speed_limits and link.drives_motion and survey is not None:
        yield _speed_limit(dialect.speed_limits[0], link.speed_limit_mps, survey)
    needs = dialect.needs if link.drives_motion else (*dialect.needs, *dialect.sticks_needs)
    for need in needs:
        yield _need(need, link.station.parameter(need.name))


def _speed_limit(name: str, limit_mps: float, survey: Survey) -> Check:
    slowest = max(target.set.speed_min_mps for target in survey.targets)
    return check(
        f"parameter {name}", f"{limit_mps:g} m/s", holds=limit_mps > slowest,
        advice=f"the survey's speed windows begin at {slowest:g} m/s: raise {name} above that",
    )  # fmt: skip


def _need(need: Need, value: float | None) -> Check:
    otherwise = Verdict.BAD if need.must else Verdict.DOUBTFUL
    found = "not found" if value is None else f"{value:g}"
    holds = value is not None and need.holds(value)
    return check(
        f"parameter {need.name}", found, holds=holds, advice=need.advice, otherwise=otherwise
    )
