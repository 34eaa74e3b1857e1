"""
8. A quantity of your own, from a track that was driven by hand
===============================================================

A TOML table describes the quantity; its column in the track is found by name.
"""

import tempfile
from pathlib import Path

import numpy as np

import grebe

folder = Path(tempfile.mkdtemp())
(folder / "quantities.toml").write_text("""
[tryptophan_rfu]
label = { en = "Tryptophan", fr = "Tryptophane" }
unit = "RFU"
cf_unit = "1"
span = [0, 100]
resolution = 0.01
columns = ['trp(rfu)?']
""")

# %%
# A made-up track: lanes ten metres apart, a reading every two seconds.

seconds = np.arange(0.0, 900.0, 2.0)
north, east = np.abs((seconds % 240) - 120), 10 * (seconds // 120)
level = 12 + 3 * np.sin(north / 40) + np.random.default_rng(1).normal(0, 0.1, len(seconds))
rows = ["time,lat,lon,Trp RFU"]
for t, n, e, value in zip(seconds, north, east, level, strict=True):
    rows.append(f"{1.75e9 + t:.0f},{50.63 + n / 111200:.7f},{3.17 + e / 70700:.7f},{value:.2f}")
(folder / "track.csv").write_text("\n".join(rows))

# %%
# The file next to the track is read automatically.

done = grebe.import_track(folder / "track.csv", folder / "track.gpkg")
print(f"{done.samples} samples of {', '.join(done.quantities)}")
for one in grebe.map_survey(folder / "track.gpkg").maps:
    error = one.validation.rmse
    print(f"{one.quantity.label}: {one.model.text}; error at lines left out: {error:.2f} RFU")
