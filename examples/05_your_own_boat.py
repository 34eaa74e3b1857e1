"""
5. A boat of your own
=====================

A vessel is one record: masses by the paper's formulas, drag from a towing test, thrusters with lag.
"""

import grebe
from grebe.core.vessel import paper_masses
from grebe.mission.trial import meander

masses = paper_masses(mass_kg=22, length_m=1.4, width_m=0.8, depth_m=0.1, propeller_distance_m=0.6)
punt = grebe.Vessel(
    name="punt", m11_kg=masses.m11_kg, m22_kg=masses.m22_kg, m33_kgm2=masses.m33_kgm2,
    x_u=-15.0, y_v=-60.0, n_r=-10.0, arm_m=0.3, thrust_max_n=25.0, thrust_min_n=-12.0,
    thruster_lag_s=0.2, throttle_exponent=2.0, source="A towing test of our own.",
)  # fmt: skip
print(f"{punt.name} makes {punt.speed_max_mps:.2f} m/s at full thrust")
print(f"12 N are {punt.throttle_of(12.0):.0%} of an actuator's command")

# %%
# The controller knows the masses and the drag; the simulated boat has the lag as well.

cells = meander(rows=2, columns=5)
trial = grebe.simulate(punt, cells, grebe.Controller(punt, cells), (-10.0, 2.5, 0, 0, 0, 0))
print(f"{trial.arrivals} sets in {trial.duration_s:.0f} s, {trial.report.energy_wh:.1f} Wh")
