"""For which sets the hypotheses of Lemmas 4 and 7 hold, and what Psi is: by search."""

from __future__ import annotations

from benchmarks.common import print_head, print_row
from grebe.control.invariance import FreeBounds, SetCheck
from grebe.core.sets import rectangle
from grebe.core.vessel import PRESETS

BOUNDS = FreeBounds(sway_mps=0.1, yaw_rate_radps=0.2)
WINDOWS = ((1.0, 2.0), (0.5, 1.5), (0.0, 1.0), (-0.3, 0.3))


def sets() -> None:
    print_head(
        "Invariance of a cell of 5 m x 5 m, T = 1 s, |v| <= 0.1 m/s, |r| <= 0.2 rad/s",
        "vessel", "window m/s", "states kept", "worst excess", "counterexample", "Psi of U",
    )  # fmt: skip
    for name in ("spyboat", "benchmark", "blueboat"):
        for window in WINDOWS:
            check = SetCheck(PRESETS[name], rectangle((0, 5), (0, 5), window), 1.0)
            found = check.search(BOUNDS)
            proof = found.counterexample
            print_row(
                f"`{name}`",
                f"{window[0]:g} to {window[1]:g}",
                f"{found.kept} of {found.states}",
                f"{found.worst_excess:.3f}",
                f"{proof.least_excess:.2f} > {proof.between:.2f}" if proof else "none found",
                f"{check.input_share(BOUNDS):.2f}",
            )
