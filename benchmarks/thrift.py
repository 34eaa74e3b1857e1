"""What `thrift` costs in time and saves in energy, boat by boat, in calm water and in a current."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.common import CELLS, START, print_head, print_row
from grebe.control.controller import Controller
from grebe.control.rules.lookahead import Lookahead
from grebe.core.dynamics import Weather
from grebe.core.sets import TargetSet
from grebe.core.vessel import PRESETS
from grebe.links.simulated import EstimateErrors
from grebe.mission.trial import Conditions, fly, meander

PRICES = (0.0, 0.2, 0.5, 1.0)
# The paper's cells for the boats of its size, and what a field team gives to boats that turn wide.
SMALL: Sequence[TargetSet] = CELLS
WIDE = meander(rows=6, columns=6, side=10.0, speed=(0.5, 1.5))
SURVEYS = {
    "benchmark": SMALL, "spyboat": SMALL, "blueboat": WIDE, "otter": WIDE, "heron": WIDE,
}  # fmt: skip
WEATHERS = {
    "calm": Conditions(limit_s=1500),
    "0.22 m/s, unknown, noise 0.03 m/s": Conditions(
        weather=Weather(current_north_mps=0.2, current_east_mps=0.1),
        errors=EstimateErrors(velocity_mps=0.03),
        limit_s=1500,
    ),
}


def thrift() -> None:
    """Time and energy of a survey by the price of thrust."""
    print_head(
        "What a price of thrust costs in time and saves in energy",
        "boat", "weather", "price", "reached", "s", "Wh", "time", "energy",
    )  # fmt: skip
    for name, cells in SURVEYS.items():
        boat = PRESETS[name]
        for weather, conditions in WEATHERS.items():
            plain = None
            for price in PRICES:
                helm = Controller(boat, cells, Lookahead(thrift=price))
                flight = fly(boat, cells, helm, START, conditions)
                told = flight.duration_s, flight.report.energy_wh
                plain = plain or told
                shares = [
                    f"{100 * (now / then - 1):+.1f} %"
                    for now, then in zip(told, plain, strict=True)
                ]
                print_row(
                    name, weather, price, flight.arrivals,
                    f"{told[0]:.1f}", f"{told[1]:.2f}", *shares,
                )  # fmt: skip
