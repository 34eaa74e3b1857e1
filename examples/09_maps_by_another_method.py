"""
9. Maps by another method
=========================

Two methods are fitted to the same readings around an island, and compared on both sides of it.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely

import grebe
from grebe.mapping.grid import make_grid
from grebe.mapping.methods.base import Domain, Readings

water = shapely.box(0, 0, 100, 100).difference(shapely.box(45, 20, 55, 100))
domain = Domain(outline=water, grid=make_grid(water, 2.0))
rng = np.random.default_rng(2)
places = rng.uniform(0, 100, (250, 2))
places = places[shapely.contains_xy(water, places)]
values = np.where(places[:, 0] < 50, 8.0, 9.0) + rng.normal(0, 0.05, len(places))
readings = Readings(positions=places, values=values)

# %%
# Kriging correlates places through the island; the field of the stochastic equation does so around
# it.

figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for side, method in zip(axes, (grebe.Kriging(), grebe.Spde()), strict=True):
    field = method.fit(readings, domain)
    mean = field.mean(domain.grid.nodes)
    print(f"{method.label}: {field.model.text}")
    side.scatter(domain.grid.nodes[:, 1], domain.grid.nodes[:, 0], c=mean, s=8, cmap="cividis")
    side.set(aspect="equal", title=method.label)
plt.show()
