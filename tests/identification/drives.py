"""Drives of known boats: the manoeuvre, in a current, with the noise of a good receiver."""

from dataclasses import replace

import numpy as np

from grebe.core.dynamics import Weather
from grebe.core.vessel import PRESETS
from grebe.identification.drive_log import DriveLog
from grebe.identification.manoeuvre import Circle, Manoeuvre, programme
from grebe.simulation.plant import Plant, mismatched

NOISE = np.array([0.3, 0.3, np.radians(0.5), 0.03, 0.03, np.radians(0.5)])
CURRENT = Weather(current_north_mps=0.1, current_east_mps=-0.05)
# The plant's thrust is constant over a step; this step is short enough to add no latency.
PLANT_STEP_S = 0.01


def boat_unlike(preset, seed, share=0.4, lag_s=0.0):
    """A boat that differs from its preset in every parameter that a drive determines."""
    return replace(
        mismatched(preset, share, seed), arm_m=preset.arm_m, thruster_lag_s=lag_s, name="truth"
    )


def manoeuvre_of(
    true, believed, seed=0, *, latency_s=0.0, seconds=180.0, radius_m=40.0, noise=NOISE
):
    """Drive the manoeuvre for the believed boat with the true boat.

    Returns the log, and the true states (n, 6) at its rows.
    """
    random = np.random.default_rng(seed)
    plant = Plant(true, (0.0,) * 6, CURRENT)
    circle = Circle(north_m=0.0, east_m=0.0, radius_m=radius_m)
    manoeuvre = Manoeuvre(
        believed, circle, speed_max_mps=0.8 * believed.speed_max_mps, legs=programme(seconds)
    )
    times, states, truth, told, under_way = [], [], [], [], []
    for k in range(10**6):
        now = k * PLANT_STEP_S
        if k % 10 == 0:
            truth.append(plant.state)
            states.append(plant.state + noise * random.normal(size=6))
            thrusts = manoeuvre.thrusts(now, states[-1])
            times.append(now)
            told.append(thrusts)
            under_way.append((now + latency_s, thrusts))
            if manoeuvre.is_over:
                break
        while under_way and under_way[0][0] <= now + 1e-9:
            plant.command(under_way.pop(0)[1])
        plant.advance(PLANT_STEP_S)
    times = np.array(times)
    log = DriveLog(
        name="drive",
        times=times,
        states=np.array(states),
        command_times=times,
        commands=np.array(told),
        unit="newton",
    )
    return log, np.array(truth)


def spyboat_drive(seed=1, **how):
    """A spyboat with a delay, its preset, and its log."""
    preset = PRESETS["spyboat"]
    true = boat_unlike(preset, seed, lag_s=0.6)
    log, truth = manoeuvre_of(true, preset, seed, latency_s=0.3, **how)
    return preset, true, log, truth
