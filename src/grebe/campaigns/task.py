"""One mission of a campaign: a pure function of the settings and its number.

The summary contains nothing that depends on the clock, so it is the same on every run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import shapely

from grebe.campaigns.sailing import sail
from grebe.campaigns.settings import Campaign
from grebe.campaigns.spread import Value
from grebe.core.errors import GrebeError, StoppedError
from grebe.core.events import EndReason
from grebe.core.survey import Survey
from grebe.mission.events.statistics import MissionReport


@dataclass(frozen=True, kw_only=True)
class Summary:
    """The result of one mission of a campaign.

    `drawn` are its settings; `ended` is the reason for which the mission ended, `error` the reason
    why it could not be sailed; `duration_s` is the boat's time [s]; `clearance_m` is the least
    distance of its centre from the edge of the water, negative outside it, at the 10 Hz of the
    estimates.
    """

    number: int
    success: bool
    in_time: bool
    in_water: bool
    reached: int
    targets: int
    duration_s: float
    clearance_m: float
    path_m: float
    energy_wh: float
    ended: str
    error: str
    drawn: Mapping[str, Value]

    def row(self) -> dict[str, Any]:
        """Return the summary as one row of a table; each drawn setting has a column of its own."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return {**{k: v for k, v in own.items() if k != "drawn"}, **self.drawn}


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What all missions of a campaign share. Called with a number, it sails that mission."""

    campaign: Campaign
    survey: Survey

    def __call__(self, number: int) -> Summary:
        """Sail one mission. An error of the mission itself is recorded as a failure; a
        `StoppedError`, by which somebody stops the campaign, is raised.
        """
        drawn = self.campaign.drawn(number)
        try:
            report, track = sail(self.campaign, self.survey, drawn, number)
        except StoppedError:
            raise
        except (GrebeError, ArithmeticError, ValueError) as error:
            return self._failed(number, drawn, str(error))
        return self._summary(number, drawn, report, clearance_m(self.survey, track))

    def _summary(
        self, number: int, drawn: Mapping[str, Value], report: MissionReport, clearance: float
    ) -> Summary:
        wanted = self.campaign.success
        in_time = (
            report.complete
            and report.ended is EndReason.COMPLETE
            and report.duration_s <= wanted.within_s
        )
        in_water = clearance >= wanted.clearance_m
        return Summary(
            number=number,
            success=in_time and in_water,
            in_time=in_time,
            in_water=in_water,
            reached=report.reached,
            targets=report.targets,
            duration_s=report.duration_s,
            clearance_m=round(clearance, 4),
            path_m=report.path_m,
            energy_wh=report.energy_wh,
            ended="" if report.ended is None else report.ended.value,
            error="",
            drawn=drawn,
        )

    def _failed(self, number: int, drawn: Mapping[str, Value], error: str) -> Summary:
        return Summary(
            number=number,
            success=False,
            in_time=False,
            in_water=False,
            reached=0,
            targets=len(self.survey.targets),
            duration_s=0.0,
            clearance_m=math.nan,
            path_m=0.0,
            energy_wh=0.0,
            ended="",
            error=error,
            drawn=drawn,
        )


def clearance_m(survey: Survey, track: np.ndarray) -> float:
    """Return the least distance [m] of places (n, 2) from the water's edge, negative outside.

    No-go zones do not count as water.
    """
    water = shapely.difference(survey.water, shapely.union_all(survey.no_go))
    shapely.prepare(water)
    places = shapely.points(track)
    far = shapely.distance(shapely.boundary(water), places)
    return float(np.min(np.where(shapely.covers(water, places), far, -far)))
