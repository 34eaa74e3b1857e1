"""How well the three-minute manoeuvre determines a boat, for several boats and seeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from benchmarks.common import print_head, print_row
from grebe.core.dynamics import Weather
from grebe.core.vessel import PRESETS, Vessel
from grebe.identification.drive_log import DriveLog
from grebe.identification.identify import identify
from grebe.identification.manoeuvre import Circle, Manoeuvre
from grebe.simulation.plant import Plant, mismatched

# Standard deviations of position, heading, velocities and yaw rate; ten times a second.
NOISE = np.array([0.3, 0.3, math.radians(0.5), 0.03, 0.03, math.radians(0.5)])
CURRENT = Weather(current_north_mps=0.1, current_east_mps=-0.05)
RADIUS_M = 40.0
SEEDS = 10
# By boat: lag of the thrusters and latency of the commands [s].
BOATS = {
    "blueboat": (0.0, 0.0),
    "otter": (0.1, 0.0),
    "heron": (0.0, 0.0),
    "spyboat": (0.6, 0.3),
    "benchmark": (0.2, 0.1),
}
PLANT_STEP_S = 0.01
NUMBERS = (
    "m11_kg", "m22_kg", "m33_kgm2", "x_u", "x_uu", "y_v", "y_vv", "n_r", "n_rr", "arm_m",
    "thrust_min_n",
    "throttle_exponent", "thruster_lag_s", "latency_s",
)  # fmt: skip


def identification(seeds: int = SEEDS) -> None:
    """Relative errors of each parameter, and how realistic the standard errors are."""
    print_head(
        f"Know your boat: three minutes, {seeds} boats of each kind, all numbers 40 % off at most",
        "boat", "number", "off before, median %", "error, median %", "largest %", "rms z",
    )  # fmt: skip
    for name in BOATS:
        _table(name, [_one(name, seed) for seed in range(1, seeds + 1)])


def driven(true: Vessel, believed: Vessel, latency_s: float, seed: int) -> tuple[DriveLog, float]:
    """The log of a manoeuvre, and how far from the middle the boat came [m]."""
    random = np.random.default_rng(seed)
    plant = Plant(true, (0.0,) * 6, CURRENT)
    circle = Circle(north_m=0.0, east_m=0.0, radius_m=RADIUS_M)
    speed = min(0.8 * believed.speed_max_mps, 2.0)
    manoeuvre = Manoeuvre(believed, circle, speed_max_mps=speed)
    rows, told, under_way, farthest, k = [], [], [], 0.0, 0
    while not manoeuvre.is_over:
        now = k * PLANT_STEP_S
        if k % 10 == 0:
            state = plant.state + NOISE * random.normal(size=6)
            thrusts = manoeuvre.thrusts(now, state)
            rows.append((now, *state))
            told.append(thrusts)
            under_way.append((now + latency_s, thrusts))
            farthest = max(farthest, math.hypot(*plant.state[:2]))
        while under_way and under_way[0][0] <= now + 1e-9:
            plant.command(under_way.pop(0)[1])
        plant.advance(PLANT_STEP_S)
        k += 1
    table = np.array(rows)
    log = DriveLog(
        name="drive", times=table[:, 0], states=table[:, 1:], command_times=table[:, 0],
        commands=np.array(told), unit="newton",
    )  # fmt: skip
    return log, farthest


def _one(name: str, seed: int) -> dict[str, tuple[float, float, float, float]]:
    """For each parameter: the truth, the preset, the estimate and its standard error."""
    preset, (lag_s, latency_s) = PRESETS[name], BOATS[name]
    true = replace(mismatched(preset, 0.4, seed), arm_m=preset.arm_m, thruster_lag_s=lag_s)
    log, farthest = driven(true, preset, latency_s, seed)
    assert farthest < RADIUS_M, f"{name} {seed} left its circle: {farthest:.1f} m"
    found = identify(log, preset)
    # The plant's thrust is constant over a step, hence half a step early.
    truth = {"latency_s": latency_s - PLANT_STEP_S / 2}
    truth |= {one: abs(getattr(true, one)) for one in NUMBERS if one != "latency_s"}
    out = {
        one.name: (truth[one.name], one.before or 0.0, one.value, one.sd)
        for one in found.parameters
        if one.name in NUMBERS
    }
    out["top speed"] = (
        true.speed_max_mps, preset.speed_max_mps, found["top speed"].value, found["top speed"].sd,
    )  # fmt: skip
    check = found.hold_out
    out["position 5 s ahead"] = (math.nan, check.preset_drift_m, check.fitted_drift_m, math.nan)
    return out


def _table(name: str, runs: list[dict[str, tuple[float, float, float, float]]]) -> None:
    for number in (*NUMBERS, "top speed"):
        rows = np.array([run[number] for run in runs if number in run])
        if len(rows) == 0:
            continue
        truth, before, value, sd = rows.T
        z = math.sqrt(np.mean(((value - truth) / sd) ** 2))
        if np.abs(truth).max() < 0.01:
            off = np.abs(value - truth)
            unit = " s" if number.endswith("_s") else ""
            print_row(
                name, number, "-", f"{np.median(off):.3f}{unit}", f"{off.max():.3f}{unit}",
                f"{z:.2f}",
            )  # fmt: skip
            continue
        wrong, off = 100 * np.abs(before / truth - 1), 100 * np.abs(value / truth - 1)
        print_row(
            name, number, f"{np.median(wrong):.0f}", f"{np.median(off):.2f}", f"{off.max():.2f}",
            f"{z:.2f}",
        )  # fmt: skip
    drift = np.array([run["position 5 s ahead"][1:3] for run in runs]).T
    print_row(
        name, "position 5 s ahead, held out, m", f"{np.median(drift[0]):.2f}",
        f"{np.median(drift[1]):.2f}", f"{drift[1].max():.2f}", "-",
    )  # fmt: skip
