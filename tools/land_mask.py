"""Make `src/grebe/io/readers/land.bin`, which says of each one-degree cell whether it is near land.

Source: GLOBE 1.0 (NOAA, 1999; public domain), a mask of the ocean at 30 arc seconds, as distributed
in the package `global-land-mask` 1.0.0. Run it with that package's .npz file as argument.

A bit is set if the cell, or one that touches it, contains any land: lakes are within land, and
coasts and lagoons within a degree of it. Bits run from 90 N, 180 W eastwards, row by row.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

TO = Path(__file__).parents[1] / "src" / "grebe" / "io" / "readers" / "land.bin"
PER_DEGREE = 120


def main() -> None:
    """Write the bits."""
    ocean = np.load(sys.argv[1])["mask"]
    land = ~ocean.reshape(180, PER_DEGREE, 360, PER_DEGREE).all(axis=(1, 3))
    around = np.pad(land, ((1, 1), (0, 0)), mode="edge")
    near = around[:-2] | around[1:-1] | around[2:]
    near |= np.roll(near, 1, axis=1) | np.roll(near, -1, axis=1)
    TO.write_bytes(np.packbits(near).tobytes())


if __name__ == "__main__":
    main()
