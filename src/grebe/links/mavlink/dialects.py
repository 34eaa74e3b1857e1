"""The differences between MAVLink autopilots: their modes, and what a survey requires of them.

ArduPilot follows orders in GUIDED, and forgets them after three seconds. PX4 follows them in
OFFBOARD, which it enters only while orders already come, and leaves when they stop for
COM_OF_LOSS_T. Its modes are two numbers in one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

# MAV_AUTOPILOT numbers.
ARDUPILOTMEGA, PX4 = 3, 12


@dataclass(frozen=True, kw_only=True)
class Need:
    """A parameter, whether its value suits a survey, and what to do if it does not."""

    name: str
    holds: Callable[[float], bool]
    advice: str
    must: bool = False


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """An autopilot's modes by their numbers, and its parameters.

    The first of the parameters `speed_limits` that is not zero is the speed to which orders are
    clamped. `follows` is the mode in which orders are followed, `holds` the one without thrust, and
    `manual` that of the sticks. `asks_orders_first`: the autopilot enters `follows` only while
    orders come.
    """

    name: str
    modes: Mapping[int, str]
    follows: int
    holds: int
    manual: int
    needs: tuple[Need, ...]
    sticks_needs: tuple[Need, ...] = ()
    speed_limits: tuple[str, ...] = ()
    asks_orders_first: bool = False

    def mode_name(self, number: int) -> str:
        """Return a mode's name, or its number if it has no name here."""
        return self.modes.get(number, f"mode {number}")

    def mode_command(self, number: int) -> tuple[float, float]:
        """Return parameters 2 and 3 of MAV_CMD_DO_SET_MODE for a mode."""
        if self.asks_orders_first:
            return float(number >> 16 & 0xFF), float(number >> 24 & 0xFF)
        return float(number), 0.0


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


ARDUROVER = Dialect(
    name="ArduPilot Rover",
    modes={
        0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE",
        8: "DOCK", 9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED",
        16: "INITIALISING",
    },
    follows=15,
    holds=4,
    manual=0,
    speed_limits=("WP_SPEED", "CRUISE_SPEED"),
    needs=(
        Need(name="FRAME_CLASS", holds=lambda v: v == 2,
             advice="set FRAME_CLASS to 2 (boat), or the autopilot steers like a car"),
        Need(name="FENCE_ENABLE", holds=lambda v: v == 1,
             advice="enable the autopilot's own fence as a second guard: upload the survey's with "
             "grebe export and set FENCE_ENABLE to 1"),
        Need(name="BATT_FS_LOW_ACT", holds=lambda v: v != 0,
             advice="set BATT_FS_LOW_ACT so that a low battery brings the boat home or holds it"),
        Need(name="FS_EKF_ACTION", holds=lambda v: v != 0,
             advice="set FS_EKF_ACTION to 1, so that a boat that has lost its position holds"),
    ),
    sticks_needs=(
        Need(name="RC1_DZ", holds=lambda v: v == 0, must=True,
             advice="set RC1_DZ to 0: a dead zone of the stick swallows small differences"),
        Need(name="RC3_DZ", holds=lambda v: v == 0, must=True,
             advice="set RC3_DZ to 0: a dead zone of the stick swallows small thrusts"),
        *(
            Need(name=f"RC{channel}_{which}", holds=lambda v, pulse=pulse: v == pulse, must=True,
                 advice=f"set RC{channel}_{which} to {pulse}: sticks are sent as 1500 +- 400 us")
            for channel in (1, 3)
            for which, pulse in (("MIN", 1100), ("TRIM", 1500), ("MAX", 1900))
        ),
    ),
)  # fmt: skip

PX4_ROVER = Dialect(
    name="PX4",
    modes={
        _px4(1): "MANUAL", _px4(2): "ALTCTL", _px4(3): "POSCTL", _px4(4): "AUTO",
        _px4(4, 2): "TAKEOFF", _px4(4, 3): "HOLD", _px4(4, 4): "MISSION", _px4(4, 5): "RTL",
        _px4(5): "ACRO", _px4(6): "OFFBOARD", _px4(7): "STABILIZED",
    },
    follows=_px4(6),
    holds=_px4(4, 3),
    manual=_px4(1),
    asks_orders_first=True,
    needs=(
        Need(name="COM_OF_LOSS_T", holds=lambda v: 0.3 <= v <= 5.0,
             advice="set COM_OF_LOSS_T to about 1 s, so that it soon acts on a loss of commands"),
        Need(name="COM_LOW_BAT_ACT", holds=lambda v: v != 0,
             advice="set COM_LOW_BAT_ACT so that a low battery brings the boat home"),
        Need(name="GF_ACTION", holds=lambda v: v != 0,
             advice="set GF_ACTION, the reaction to its own fence, as a second guard"),
    ),
)  # fmt: skip

DIALECTS = {ARDUPILOTMEGA: ARDUROVER, PX4: PX4_ROVER}
