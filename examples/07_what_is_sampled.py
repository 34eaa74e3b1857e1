"""
7. What is sampled
==================

By default a sample is stored for every second within the speed window; the paper stores only
samples in target sets. This makes a difference if the sets are apart, as here.
"""

import matplotlib.pyplot as plt

import grebe
from grebe.mission.trial import meander

boat, apart = grebe.vessel_named("benchmark"), meander(rows=1, columns=13)[::2]
figure, axes = plt.subplots(figsize=(8, 2.5))
for i, sampling in enumerate((grebe.InWindow(), grebe.InSets())):
    world = grebe.Conditions(sampling=sampling)
    helm = grebe.Controller(boat, apart)
    trial = grebe.simulate(boat, apart, helm, (-5.0, 2.0, 1.57, 0, 0, 0), world)
    print(f"{sampling}: {trial.report.samples} samples, {trial.report.samples_in_sets} in sets")
    axes.plot(trial.sampled[:, 1], [i] * len(trial.sampled), "o", label=type(sampling).__name__)
for cell in apart:
    axes.axvspan(cell.polygon.bounds[1], cell.polygon.bounds[3], color="0.9", zorder=0)
axes.set(xlabel="east [m]", yticks=[])
axes.legend()
plt.show()
