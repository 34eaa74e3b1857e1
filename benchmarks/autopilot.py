"""Surveys of random lakes over the stand-in autopilot, each with a fault of the list."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np
import shapely

from benchmarks.common import print_head, print_row
from grebe.control.controller import Controller
from grebe.core.dynamics import Weather
from grebe.core.errors import GrebeError, LinkError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Survey
from grebe.core.vessel import PRESETS
from grebe.links.mavlink.link import open_link
from grebe.links.mavlink.rehearsal import NO_RADIO_FAULTS, MemoryWire, RadioFaults
from grebe.links.mavlink.settings import MavlinkSettings
from grebe.links.mavlink.standin import StandIn
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.planning.planner import plan_survey
from grebe.planning.region import Region
from grebe.simulation.autopilot import (
    NO_UPSETS,
    Autopilot,
    AutopilotSettings,
    Mode,
    Upsets,
)
from grebe.simulation.plant import Plant, mismatched

LAKES = 100
FRAME = LocalFrame(origin_lon_deg=8.5, origin_lat_deg=47.3)
HULLS = ("spyboat", "blueboat", "heron", "otter")
# The hull differs from its model by up to this share.
MISMATCH = 0.2
# Each fault with its expected end of the survey; some only disturb it.
COMPLETES = "mission_complete"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A fault, when it comes [s], and how a mission with it may end besides being complete."""

    radio: RadioFaults = NO_RADIO_FAULTS
    faults: Upsets = NO_UPSETS
    ends: str = ""


def case_of(name: str, at_s: float, seed: int) -> Case:
    """The case of a fault, by its name."""
    return {
        "none": Case,
        "30 % of all messages lost": lambda: Case(radio=RadioFaults(lost_share=0.3, seed=seed)),
        "0.3 s late each way": lambda: Case(radio=RadioFaults(delay_s=0.3, seed=seed)),
        "out of order, by up to 0.4 s": lambda: Case(radio=RadioFaults(jitter_s=0.4, seed=seed)),
        "line silent for 5 s": lambda: Case(radio=RadioFaults(silence=(at_s, at_s + 5.0))),
        "line dead": lambda: Case(radio=RadioFaults(silence=(at_s, 1e9)), ends="silent for"),
        "autopilot restarts": lambda: Case(faults=Upsets(reboots_at=at_s), ends="started afresh"),
        "no fix for 4 s": lambda: Case(faults=Upsets(gps_lost=(at_s, at_s + 4.0))),
        "no fix any more": lambda: Case(
            faults=Upsets(gps_lost=(at_s, 1e9)), ends="EKF failsafe|mode HOLD"
        ),
        "stuck in HOLD": lambda: Case(faults=Upsets(stuck_in_hold=True), ends="stays in HOLD"),
        "pilot takes over": lambda: Case(faults=Upsets(pilot_takes_at=at_s), ends="mode MANUAL"),
        "battery empty": lambda: Case(
            faults=Upsets(battery_empty_at=at_s), ends="Battery failsafe|mode HOLD"
        ),
    }[name]()


NAMES = (
    "none", "30 % of all messages lost", "0.3 s late each way", "out of order, by up to 0.4 s",
    "line silent for 5 s", "line dead", "autopilot restarts", "no fix for 4 s", "no fix any more",
    "stuck in HOLD", "pilot takes over", "battery empty",
)  # fmt: skip


def random_lake(rng: np.random.Generator) -> Region:
    """A lake some dozens of metres across, of any shape, with up to two islands."""
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    waves = sum(
        rng.normal(0, 0.14 / k) * np.cos(k * angles + rng.uniform(0, 2 * np.pi))
        for k in range(2, 7)
    )
    reach = rng.uniform(35, 70) * np.exp(waves)
    water = shapely.Polygon(np.column_stack([reach * np.cos(angles), reach * np.sin(angles)]))
    for _ in range(rng.integers(0, 3)):
        place = rng.uniform(-25, 25, 2)
        water = water.difference(shapely.Point(place).buffer(rng.uniform(4, 9)))
    parts = [part for part in shapely.get_parts(water) if isinstance(part, shapely.Polygon)]
    return Region(name="random", frame=FRAME, water=max(parts, key=lambda part: part.area))


def random_survey(rng: np.random.Generator) -> Survey:
    """A survey of a random lake with a random hull."""
    hull = PRESETS[HULLS[rng.integers(len(HULLS))]]
    settings = PlanSettings(
        cell_m=float(rng.uniform(12, 20)), speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=2.0
    )
    return plan_survey(random_lake(rng), hull, settings)


def _sail(job: tuple[str, int]) -> tuple[str, str, int, float]:
    """One mission: its fault, how it ended, instants outside the water, and its duration."""
    name, seed = job
    rng = np.random.default_rng(seed)
    survey = random_survey(rng)
    case = case_of(name, float(rng.uniform(50, 120)), seed)
    around = rng.uniform(0, 2 * np.pi)
    weather = Weather(current_north_mps=0.2 * np.cos(around), current_east_mps=0.2 * np.sin(around))
    assert survey.vessel is not None
    assert survey.start is not None
    plant = Plant(mismatched(survey.vessel, MISMATCH, seed), survey.start.at_rest(), weather)
    autopilot = Autopilot(plant, AutopilotSettings(seed=seed), case.faults)
    lon, lat = FRAME.to_wgs84(survey.start.at_rest()[:2]).tolist()
    outside = 0
    shapely.prepare(survey.water)

    def watch(boat: StandIn) -> None:
        nonlocal outside
        north, east = boat.autopilot.plant.state[:2]
        ours = boat.autopilot.mode is Mode.GUIDED
        outside += ours and not shapely.intersects_xy(survey.water, north, east)

    wire = MemoryWire(StandIn(autopilot, FRAME, (lon, lat)), case.radio, watch)
    while not autopilot.knows_position:
        wire.sail()
    # Somebody held it at the jetty until then, or the current would have carried it ashore.
    plant.state = list(survey.start.at_rest())
    outside = 0
    ended, duration_s = _ended(wire, survey)
    return name, _judged(case, ended), outside, duration_s


def _ended(wire: MemoryWire, survey: Survey) -> tuple[str, float]:
    """How a mission over a wire ended, in words, and its duration."""
    assert survey.vessel is not None
    try:
        link = open_link(wire, FRAME, survey.vessel, MavlinkSettings())
        link.engage(lambda _: True)
    except LinkError as error:
        return str(error), 0.0
    helm = Controller(link.model, survey.sets, corridors=survey.corridors)
    try:
        report = Mission(survey, helm, link, MemoryRecorder()).run()
    except GrebeError as error:
        return str(error), 0.0
    if report.complete:
        return COMPLETES, report.duration_s
    return f"{report.ended}: {report.message}", report.duration_s


def _judged(case: Case, ended: str) -> str:
    if ended == COMPLETES:
        return "complete"
    if case.ends and re.search(case.ends, ended):
        return "ended safely"
    return f"WRONG ({ended})"


def autopilot() -> None:
    """Missions over the stand-in: how they end, and whether the boat stays on the water."""
    jobs = [(NAMES[seed % len(NAMES)], seed) for seed in range(LAKES)]
    with Pool(2) as pool:
        sailed = pool.map(_sail, jobs, chunksize=2)
    print_head(
        f"{LAKES} random lakes over the stand-in autopilot, current 0.2 m/s, hull unlike by "
        f"{MISMATCH:.0%}",
        "fault", "missions", "complete", "ended safely, right reason", "otherwise",
        "instants outside the water",
    )  # fmt: skip
    for name in NAMES:
        mine = [one for one in sailed if one[0] == name]
        ends = Counter(one[1] for one in mine)
        wrong = [end for end in ends if end not in ("complete", "ended safely")]
        print_row(
            name, len(mine), ends["complete"], ends["ended safely"], "; ".join(wrong) or 0,
            sum(one[2] for one in mine),
        )  # fmt: skip
