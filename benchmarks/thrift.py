"""What `thrift` costs in time and saves in energy, boat by boat, in calm water and in a current."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.common import CELLS, START, print_head, print_row
from grebe.control.controller import Controller
from grebe.control.rules.lookahead import Lookahead
from grebe.core.dynamics import Weather
from grebe.core.sets import TargetSet
from grebe.core.vessel import PRESETS
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, Trial, meander, simulate

PRICES = (0.2, 0.5, 1.0)
# The paper's cells for boats of its size, and a field team's for boats that turn wide.
SMALL: Sequence[TargetSet] = CELLS
WIDE = meander(rows=6, columns=6, side=10.0, speed=(0.5, 1.5))
SURVEYS = {
    "benchmark": SMALL, "spyboat": SMALL, "blueboat": WIDE, "otter": WIDE, "heron": WIDE,
}  # fmt: skip
CALM, MOVING = "calm", "0.22 m/s, unknown, noise 0.03 m/s"
WEATHERS = {
    CALM: Conditions(limit_s=1500),
    MOVING: Conditions(
        weather=Weather(current_north_mps=0.2, current_east_mps=0.1),
        errors=EstimateErrors(velocity_mps=0.03),
        limit_s=1500,
    ),
}


@dataclass(frozen=True, kw_only=True)
class Priced:
    """A flight at a price of thrust, and its time and energy over those of the flight without a
    price, as shares, below zero where it takes less.
    """

    price: float
    flight: Trial
    more_time: float = 0.0
    more_energy: float = 0.0


def priced(boat: str, weather: str) -> Iterator[Priced]:
    """Sail a boat's survey without a price, then at each price."""
    plain = _flown(boat, weather, 0.0)
    yield Priced(price=0.0, flight=plain)
    for price in PRICES:
        flight = _flown(boat, weather, price)
        yield Priced(
            price=price,
            flight=flight,
            more_time=flight.duration_s / plain.duration_s - 1,
            more_energy=flight.report.energy_wh / plain.report.energy_wh - 1,
        )


def _flown(boat: str, weather: str, price: float) -> Trial:
    vessel, cells = PRESETS[boat], SURVEYS[boat]
    helm = Controller(vessel, cells, Lookahead(thrift=price))
    return simulate(vessel, cells, helm, START, WEATHERS[weather])


def most_saved(boat: str, weather: str, longer: float = 0.1) -> float:
    """The greatest share of energy that a price saves within `longer` more time, of the complete
    flights; 0 if none does.
    """
    within = [
        -one.more_energy
        for one in priced(boat, weather)
        if one.flight.complete and one.more_time <= longer
    ]
    return max(within, default=0.0)


def thrift() -> None:
    """Time and energy of a survey by the price of thrust."""
    print_head(
        "What a price of thrust costs in time and saves in energy",
        "boat", "weather", "price", "reached", "s", "Wh", "time", "energy",
    )  # fmt: skip
    for boat in SURVEYS:
        for weather in WEATHERS:
            for one in priced(boat, weather):
                print_row(
                    boat, weather, one.price, one.flight.arrivals,
                    f"{one.flight.duration_s:.1f}", f"{one.flight.report.energy_wh:.2f}",
                    f"{100 * one.more_time:+.1f} %", f"{100 * one.more_energy:+.1f} %",
                )  # fmt: skip
