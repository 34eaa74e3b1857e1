"""Thrusts as lines of JSON, which any small board on a boat can read.

One line, ended by a newline, one datagram each over UDP:

    {"t":12.3,"port_n":5.0,"starboard_n":4.2,"port":0.4,"starboard":0.34,"seq":118}

`t` is the link's time [s], and `port_n` and `starboard_n` are thrusts [N]. `port` and `starboard`
are the commands of the actuators from -1 (full astern) to 1 (full ahead), by the vessel's own
curve. `seq` counts the lines from 0. A line comes at least five times a second while a mission
runs. A receiver that gets none for `RECEIVER_S` must remove all thrust: this stops a boat whose
mission has died, so nothing else may send these lines. On a stop both thrusts are zero, and so they
are in the last line.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

from grebe.core.vessel import Vessel

# The receiver removes all thrust after this long without a line [s].
RECEIVER_S = 1.0
# The longest time between two lines while a mission runs [s].
KEEP_ALIVE_S = 0.2
NUMBERS = ("t", "port_n", "starboard_n", "port", "starboard")


@dataclass(frozen=True, kw_only=True)
class ThrustLine:
    """One line; see the module."""

    t: float
    port_n: float
    starboard_n: float
    port: float
    starboard: float
    seq: int

    def encoded(self) -> bytes:
        """Return the line as it is sent."""
        return json.dumps(asdict(self), separators=(",", ":")).encode() + b"\n"


def thrust_line(
    vessel: Vessel, thrusts: tuple[float, float], time_s: float, seq: int
) -> ThrustLine:
    """Return the line for thrusts (port, starboard) [N]."""
    port, starboard = thrusts
    return ThrustLine(
        t=round(time_s, 3),
        port_n=round(port, 3),
        starboard_n=round(starboard, 3),
        port=round(vessel.throttle_of(port), 5),
        starboard=round(vessel.throttle_of(starboard), 5),
        seq=seq,
    )


def read_thrust_line(line: bytes) -> ThrustLine | None:
    """Return a line as a receiver reads it; None if it is damaged or incomplete."""
    try:
        found = json.loads(line)
        numbers = {name: float(found[name]) for name in NUMBERS}
        said = ThrustLine(**numbers, seq=int(found["seq"]))
    except (ValueError, KeyError, TypeError, OverflowError):
        return None
    return said if all(map(math.isfinite, numbers.values())) else None
