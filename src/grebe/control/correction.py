"""By how much a boat differs from its model, in numbers that a controller can plan with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Lags below this are ignored [s].
LEAST_LAG_S = 0.15
# A correction is followed where it moved by more than this in any of its numbers.
WORTH_A_CHANGE = np.array([0.08, 0.08, 0.12, 0.2, 0.12, 0.12, 0.1, 0.15, 0.03])


@dataclass(frozen=True, kw_only=True)
class Correction:
    """How the boat differs from its model.

    `port`, `starboard`: the share of its order that a thruster gives. `drag` of surge,
    `sway_drag`, `yaw_inertia`, `yaw_drag`: factors on the model's. `dead_s` and `lag_s`: how late
    orders act, or estimates come. `heading_rad`: by how much the compass shows too much.
    """

    port: float = 1.0
    starboard: float = 1.0
    drag: float = 1.0
    sway_drag: float = 1.0
    yaw_inertia: float = 1.0
    yaw_drag: float = 1.0
    dead_s: float = 0.0
    lag_s: float = 0.0
    heading_rad: float = 0.0

    def vessel(self, model: Vessel) -> Vessel:
        """Return the boat that a controller should plan for: what both thrusters can give."""
        weaker = min(self.port, self.starboard)
        return replace(
            model,
            m33_kgm2=self.yaw_inertia * model.m33_kgm2,
            x_u=self.drag * model.x_u,
            x_uu=self.drag * model.x_uu,
            y_v=self.sway_drag * model.y_v,
            y_vv=self.sway_drag * model.y_vv,
            n_r=self.yaw_drag * model.n_r,
            n_rr=self.yaw_drag * model.n_rr,
            thrust_max_n=weaker * model.thrust_max_n,
            thrust_min_n=weaker * model.thrust_min_n,
            thruster_dead_band_n=0.0,
        )

    @property
    def numbers(self) -> Array:
        """The correction as numbers (9,), in the order of its fields: logarithms of the factors."""
        factors = (
            self.port,
            self.starboard,
            self.drag,
            self.sway_drag,
            self.yaw_inertia,
            self.yaw_drag,
        )
        return np.array([*map(math.log, factors), self.dead_s, self.lag_s, self.heading_rad])

    @classmethod
    def of(cls, numbers: Array) -> Correction:
        """The correction of numbers (9,) and more."""
        port, starboard, drag, sway_drag, inertia, yaw_drag = np.exp(numbers[:6]).tolist()
        dead_s, lag_s, heading_rad = numbers[6:9].tolist()
        return cls(
            port=port,
            starboard=starboard,
            drag=drag,
            sway_drag=sway_drag,
            yaw_inertia=inertia,
            yaw_drag=yaw_drag,
            dead_s=dead_s,
            lag_s=lag_s,
            heading_rad=heading_rad,
        )

    def __str__(self) -> str:
        if self == AS_MODELLED:
            return "the boat is as its model says after all"
        return (
            "the boat is not as its model says: "
            f"thrusters give {self.port:.2f} and {self.starboard:.2f} of their orders, drag x "
            f"{self.drag:.2f}, sway drag x {self.sway_drag:.2f}, yaw inertia x "
            f"{self.yaw_inertia:.2f}, yaw drag x {self.yaw_drag:.2f}, "
            f"{self.dead_s:.1f} s late with a lag of {self.lag_s:.1f} s, compass off by "
            f"{math.degrees(self.heading_rad):.0f} deg"
        )


AS_MODELLED = Correction()


def as_modelled(model: Vessel) -> Correction:
    """The boat as its model says: its thrusters have the lag that is known of them, where that is
    long enough to be made up for.
    """
    lag_s = model.thruster_lag_s
    return AS_MODELLED if lag_s < LEAST_LAG_S else Correction(lag_s=lag_s)


def moved_enough(before: Correction, after: Correction) -> bool:
    """Whether a correction differs so much from the one that is followed that it is worth it."""
    change = np.abs(after.numbers - before.numbers)
    return bool(np.any(change > WORTH_A_CHANGE))


def turned(states: Array, angle_rad: float) -> Array:
    """States (n, 6) whose compass shows `angle_rad` more: the same velocities over ground."""
    if angle_rad == 0.0:
        return states
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    out = np.empty_like(states)
    turn(states.T, angle_rad, cos, sin, out.T)
    return out


def turn(state: Array, angle_rad: float, cos: float, sin: float, out: Array) -> None:
    """Put a state (6,), or states side by side (6, n), into `out` as a compass shows them that
    shows `angle_rad` more, an angle of this cosine and sine. The search for a correction compiles
    it.
    """
    for i in range(6):
        out[i] = state[i]
    out[2] += angle_rad
    out[3] = cos * state[3] + sin * state[4]
    out[4] = cos * state[4] - sin * state[3]
