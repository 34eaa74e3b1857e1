"""Whether a vessel's numbers are those of one small boat in SI units.

Each number of a vessel may be possible by itself. Thrusts in kilograms, masses in grams or an arm
in centimetres show in how the numbers go together: in the boat's speed, in how quickly it gets
there, and in its size.
"""

from __future__ import annotations

import math

from grebe.core.vessel import Vessel

# What small survey boats stay well within: top speed [m/s], seconds to stop drifting or to reach
# half of the top speed, and the arm over the radius of gyration.
FASTEST_MPS, SLOWEST_MPS = 8.0, 0.3
QUICKEST_S, SLUGGISH_S = 0.1, 60.0
MOST_ARMS, FEWEST_ARMS = 8.0, 0.05


def doubts_about(vessel: Vessel) -> list[str]:
    """Return sentences about numbers that do not go together in one small boat, in SI units."""
    found: list[str] = []
    top = vessel.speed_max_mps
    if not SLOWEST_MPS <= top <= FASTEST_MPS:
        found.append(
            f"{vessel.name} would reach {top:.3g} m/s at full thrust; are its thrusts in newtons, "
            "and its drag in newtons at so many m/s?"
        )
    push = 2.0 * vessel.thrust_max_n
    pick_up_s = vessel.m11_kg * top / 2.0 / push
    if not QUICKEST_S <= pick_up_s <= SLUGGISH_S:
        found.append(
            f"{vessel.name} would take {pick_up_s:.3g} s to gain half of its top speed; are its "
            "masses in kilograms and its thrusts in newtons?"
        )
    gyration_m = math.sqrt(vessel.m33_kgm2 / vessel.m22_kg)
    if not FEWEST_ARMS <= vessel.arm_m / gyration_m <= MOST_ARMS:
        found.append(
            f"{vessel.name} has its thrusters {vessel.arm_m:g} m from the middle, but turns like a "
            f"boat whose mass is {gyration_m:.2g} m from it; are arm and inertia in metres and "
            "kg m2?"
        )
    return found
