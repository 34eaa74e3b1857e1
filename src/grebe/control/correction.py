"""The difference between a boat and its model, in a form that a controller can plan with."""

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
# A new correction is adopted if any of its numbers changed by more than this.
WORTH_A_CHANGE = np.array([0.08, 0.08, 0.12, 0.2, 0.12, 0.12, 0.1, 0.15, 0.03])


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Difference between a boat and its model.

    `port`, `starboard`: the share of its order that a thruster gives. `drag` of surge,
    `sway_drag`, `yaw_inertia`, `yaw_drag`: factors on the model's. `dead_s` and `lag_s`: delay of
    orders, or of estimates. `heading_rad`: the compass's error, positive if it shows too much.
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
        """Return the boat to plan for, with the thrust that both thrusters can give."""
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
        """The correction as numbers (9,), in the order of its fields; factors as logarithms."""
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
        """The correction given by the first nine numbers."""
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
            return "the boat matches its model again"
        return (
            f"the boat differs from its model: thrusters give {self.port:.2f} and "
            f"{self.starboard:.2f} of their orders, drag x {self.drag:.2f}, sway drag x "
            f"{self.sway_drag:.2f}, yaw inertia x {self.yaw_inertia:.2f}, yaw drag x "
            f"{self.yaw_drag:.2f}, thrust {self.dead_s:.1f} s late with a lag of "
            f"{self.lag_s:.1f} s, compass off by {math.degrees(self.heading_rad):.0f} deg"
        )


AS_MODELLED = Correction()


def as_modelled(model: Vessel) -> Correction:
    """The correction of a boat as modelled: the model's lag, if it is worth compensating."""
    lag_s = model.thruster_lag_s
    return AS_MODELLED if lag_s < LEAST_LAG_S else Correction(lag_s=lag_s)


def moved_enough(before: Correction, after: Correction) -> bool:
    """Whether a correction differs enough from the one followed to be adopted."""
    change = np.abs(after.numbers - before.numbers)
    return bool(np.any(change > WORTH_A_CHANGE))


def turned(states: Array, angle_rad: float) -> Array:
    """States (n, 6) with `angle_rad` added to the heading, at the same velocities over ground."""
    if angle_rad == 0.0:
        return states
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    out = np.empty_like(states)
    turn(states.T, angle_rad, cos, sin, out.T)
    return out


def turn(state: Array, angle_rad: float, cos: float, sin: float, out: Array) -> None:
    """Write a state (6,), or states side by side (6, n), with `angle_rad` added to the heading.

    `cos` and `sin` are those of the angle; `out` has the shape of `state`. The search for a
    correction compiles this function.
    """
    for i in range(6):
        out[i] = state[i]
    out[2] += angle_rad
    out[3] = cos * state[3] + sin * state[4]
    out[4] = cos * state[4] - sin * state[3]
