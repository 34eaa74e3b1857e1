"""Boats: the parameters of Eq. (9), masses computed from the hull, and presets.

`Vessel` holds the parameters of the equations. `paper_masses` is the paper's section 5.1.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from numbers import Real
from typing import Literal

from grebe.core.errors import VesselError

YAW_COUPLINGS = ("fossen", "printed")
_DRIVE = ("propeller_diameter_m", "drive_efficiency")


@dataclass(frozen=True, kw_only=True)
class Vessel:
    """A boat with differential thrust; symbols and signs as in Eq. (9).

    Masses include the added mass. Drag coefficients are zero or negative: `x_u`, `y_v`
    [N s/m], `n_r` [N m s], `x_uu`, `y_vv` [N s^2/m^2], `n_rr` [N m s^2]. `arm_m` is b, half
    the distance between the thrusters. The thrust limits hold for each thruster; a thrust smaller
    than the dead band has no effect. Thrust grows with the actuator's command, as a share of full
    command, to the power of `throttle_exponent`: 1 if an inner loop makes thrust proportional to
    the command, 2 for a propeller whose speed follows it.
    Propeller diameter and drive efficiency are used only in the energy estimate; their defaults
    are assumptions without a source.
    `yaw_coupling` chooses the sign in the last row of Eq. (9): "fossen" is (m11 - m22) u v,
    which does no work; "printed" is the paper's (m22 - m11) u v (see docs/theory.md).

    Raises `VesselError` when a value is impossible.
    """

    name: str
    m11_kg: float
    m22_kg: float
    m33_kgm2: float
    x_u: float
    y_v: float
    n_r: float
    x_uu: float = 0.0
    y_vv: float = 0.0
    n_rr: float = 0.0
    arm_m: float
    thrust_max_n: float
    thrust_min_n: float
    thruster_lag_s: float = 0.0
    thruster_dead_band_n: float = 0.0
    throttle_exponent: float = 1.0
    propeller_diameter_m: float = 0.12
    drive_efficiency: float = 0.5
    yaw_coupling: Literal["fossen", "printed"] = "fossen"
    source: str = ""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type == "float" and (isinstance(value, bool) or not isinstance(value, Real)):
                raise VesselError(f"Vessel {self.name!r}: {field.name} is {value!r}, not a number.")
            if isinstance(value, float | int) and not math.isfinite(value):
                raise VesselError(
                    f"Vessel {self.name!r}: {field.name} is {value}; give a finite number."
                )
        for name in (
            "m11_kg",
            "m22_kg",
            "m33_kgm2",
            "arm_m",
            "thrust_max_n",
            "throttle_exponent",
            *_DRIVE,
        ):
            if getattr(self, name) <= 0:
                raise VesselError(
                    f"Vessel {self.name!r}: {name} is {getattr(self, name)}; it must be positive."
                )
        for name in ("x_u", "y_v", "n_r", "x_uu", "y_vv", "n_rr", "thrust_min_n"):
            if getattr(self, name) > 0:
                raise VesselError(
                    f"Vessel {self.name!r}: {name} is {getattr(self, name)}; "
                    "it must not be positive (drag and reverse thrust act backwards)."
                )
        if self.x_u + self.x_uu >= 0 or self.y_v + self.y_vv >= 0 or self.n_r + self.n_rr >= 0:
            raise VesselError(f"Vessel {self.name!r} has no drag in surge, sway or yaw.")
        if self.yaw_coupling not in YAW_COUPLINGS:
            raise VesselError(
                f"Vessel {self.name!r}: yaw_coupling is {self.yaw_coupling!r}; choose one of "
                f"{', '.join(YAW_COUPLINGS)}."
            )
        if self.thruster_lag_s < 0:
            raise VesselError(f"Vessel {self.name!r}: thruster_lag_s is negative.")
        if not 0 <= self.thruster_dead_band_n < self.thrust_max_n:
            raise VesselError(
                f"Vessel {self.name!r}: thruster_dead_band_n is {self.thruster_dead_band_n}; "
                f"it must lie between 0 and thrust_max_n = {self.thrust_max_n}."
            )

    @property
    def yaw_coupling_kg(self) -> float:
        """Factor of u v in the last row of Eq. (9)."""
        fossen = self.m11_kg - self.m22_kg
        return fossen if self.yaw_coupling == "fossen" else -fossen

    @cached_property
    def speed_max_mps(self) -> float:
        """Steady surge in still water under full thrust of both thrusters."""
        return steady_rate(-self.x_u, -self.x_uu, 2 * self.thrust_max_n)

    @cached_property
    def fastest_rate_hz(self) -> float:
        """Fastest decay rate [1/s] of surge, sway or yaw within the boat's reach.

        An explicit integration step must stay below about twice its inverse.
        """
        turning = self.arm_m * (self.thrust_max_n - self.thrust_min_n)
        yaw_max = steady_rate(-self.n_r, -self.n_rr, turning)
        speed = self.speed_max_mps
        return max(
            -(self.x_u + 2 * self.x_uu * speed) / self.m11_kg,
            -(self.y_v + 2 * self.y_vv * speed) / self.m22_kg,
            -(self.n_r + 2 * self.n_rr * yaw_max) / self.m33_kgm2,
        )

    def throttle_of(self, thrust_n: float) -> float:
        """Command of an actuator, -1 to 1, for a thrust [N]; full beyond the limits."""
        full = self.thrust_max_n if thrust_n >= 0 else -self.thrust_min_n
        if thrust_n == 0 or full == 0:
            return 0.0
        share = min(abs(thrust_n) / full, 1.0)
        return math.copysign(share ** (1 / self.throttle_exponent), thrust_n)

    def thrust_of(self, throttle: float) -> float:
        """Thrust [N] that an actuator gives at a command from -1 to 1."""
        full = self.thrust_max_n if throttle >= 0 else -self.thrust_min_n
        return math.copysign(full * min(abs(throttle), 1.0) ** self.throttle_exponent, throttle)

    def surge_drag_n(self, surge_mps: float) -> float:
        """Thrust [N] that holds a steady surge in still water."""
        return -(self.x_u + self.x_uu * abs(surge_mps)) * surge_mps


def steady_rate(linear: float, quadratic: float, load: float) -> float:
    """Positive root w of linear w + quadratic w^2 = load."""
    if quadratic == 0:
        return load / linear
    return (math.sqrt(linear**2 + 4 * quadratic * load) - linear) / (2 * quadratic)


@dataclass(frozen=True, kw_only=True)
class HullMasses:
    """Masses with added mass: m_11, m_22 [kg] and m_33 [kg m^2]."""

    m11_kg: float
    m22_kg: float
    m33_kgm2: float


def paper_masses(
    *,
    mass_kg: float,
    length_m: float,
    width_m: float,
    depth_m: float,
    propeller_distance_m: float,
    water_kgm3: float = 1000.0,
) -> HullMasses:
    """Masses from the hull, by the three formulas below Eq. (9).

    `length_m` is the hull's length in the water, `depth_m` its mean submerged depth. Raises
    `VesselError` unless every argument is positive and finite.
    """
    sizes = (mass_kg, length_m, width_m, depth_m, propeller_distance_m, water_kgm3)
    if not all(0 < size < math.inf for size in sizes):
        raise VesselError("A hull's mass, its sizes and the water's density must be above 0.")
    displaced = water_kgm3 * math.pi * depth_m**2 * length_m
    inertia = mass_kg * (length_m**2 + width_m**2)
    added_inertia = 0.5 * (0.1 * mass_kg * propeller_distance_m**2 + displaced * length_m**2)
    return HullMasses(
        m11_kg=1.05 * mass_kg,
        m22_kg=mass_kg + 0.5 * displaced,
        m33_kgm2=(inertia + added_inertia) / 12,
    )


PRESETS: dict[str, Vessel] = {
    vessel.name: vessel
    for vessel in (
        Vessel(
            **vars(
                paper_masses(
                    mass_kg=10, length_m=1.2, width_m=0.6, depth_m=0.06, propeller_distance_m=0.5
                )
            ),
            name="spyboat",
            x_u=-10.0,
            y_v=-30.0,
            n_r=-3.0,
            arm_m=0.25,
            thrust_max_n=12.5,
            thrust_min_n=-6.0,
            source="Illustrative: the paper's mass formulas with guessed hull and drag; "
            "the SPYBOAT's own values (Hervagault 2019) are not public.",
        ),
        Vessel(
            **vars(
                paper_masses(
                    mass_kg=30, length_m=1.3, width_m=0.9, depth_m=0.15, propeller_distance_m=0.7
                )
            ),
            name="benchmark",
            x_u=-20.0,
            y_v=-60.0,
            n_r=-15.0,
            arm_m=0.35,
            thrust_max_n=20.0,
            thrust_min_n=-10.0,
            source="Synthetic: the boat of the 100-cell benchmark.",
        ),
        Vessel(
            name="blueboat",
            m11_kg=41.770,
            m22_kg=22.558,
            m33_kgm2=25.649,
            x_u=0.0,
            y_v=-51.547,
            n_r=-44.652,
            x_uu=-14.9,
            arm_m=0.285,
            thrust_max_n=55.21,
            thrust_min_n=-27.56,
            source="jankristia/BlueBoatSystemIdentification; surge drag refitted on its logs.",
        ),
        Vessel(
            name="otter",
            m11_kg=60.5,
            m22_kg=137.5,
            m33_kgm2=45.265,
            x_u=-77.554,
            y_v=-137.5,
            n_r=-45.265,
            n_rr=-452.65,
            arm_m=0.395,
            thrust_max_n=119.68,
            thrust_min_n=-66.71,
            thruster_lag_s=0.1,
            source="cybergalactic/PythonVehicleSimulator, no payload.",
        ),
        Vessel(
            name="heron",
            m11_kg=35.96,
            m22_kg=35.96,
            m33_kgm2=10.0,
            x_u=0.0,
            y_v=-99.99,
            n_r=-0.830,
            x_uu=-17.258,
            y_vv=-99.99,
            n_rr=-17.336,
            arm_m=0.3777,
            thrust_max_n=22.0,
            thrust_min_n=-4.0,
            source="JunghwanRo/RANS-ASV-IROS2024, identified Clearpath Heron.",
        ),
        Vessel(
            name="tianjin",
            m11_kg=50.05,
            m22_kg=84.36,
            m33_kgm2=17.21,
            x_u=-151.57,
            y_v=-132.5,
            n_r=-34.56,
            arm_m=0.26,
            thrust_max_n=100.0,
            thrust_min_n=-100.0,
            source="VectorWang2015/MarineVesselModels after Sensors 2019.",
        ),
    )
}


def vessel_named(name: str) -> Vessel:
    """Return the preset of that name; `VesselError` names the nearest one otherwise."""
    if name in PRESETS:
        return PRESETS[name]
    near = difflib.get_close_matches(name.lower(), PRESETS, n=1, cutoff=0.0)
    raise VesselError(
        f"There is no vessel named {name!r}; the nearest is {near[0]!r} "
        f"(known: {', '.join(sorted(PRESETS))})."
    )


def with_printed_sign(vessel: Vessel) -> Vessel:
    """Return the vessel with the sign of the last row of Eq. (9) as printed in the paper."""
    return replace(vessel, yaw_coupling="printed")
