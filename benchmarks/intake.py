"""Judge the tests for a settling sonde and for bubbles on faults of known truth.

`python -m benchmarks.intake FOLDER_OF_TRACKS`: records cut at random later times (when no sensor
settles), approaches planted at the cuts, bubbles and fronts planted in the conductivity.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from grebe.core.quantities import BUILTIN
from grebe.core.samples import Samples
from grebe.io.readers.profile import read_profile
from grebe.io.readers.track import read_track
from grebe.mapping.quality.bubbles import bubbles
from grebe.mapping.quality.settling import settling_times
from grebe.workflow.tracks import samples_of_track, survey_of_track

CUTS, BUBBLES = 100, 40
WITNESSES = ("temperature_degc", "dissolved_oxygen_mgl", "ph", "chlorophyll_rfu")


def samples_of(path: Path) -> Samples:
    with path.open(encoding="utf-8") as file:
        bare = file.readline()[0].isdigit()
    raw = read_track(path, profile=read_profile("catabot") if bare else None)
    return samples_of_track(raw, survey_of_track(raw, "x"))


def settling(samples: Samples, rng: np.random.Generator) -> dict[str, str]:
    """False alarms among the cuts, and hits on a pH that starts off by ranges of the record."""
    columns = {key: one for key, one in samples.values.items() if BUILTIN[key].on_sonde}
    n, false, hits = len(samples), 0, dict.fromkeys((0.5, 1.0, 1.5, 2.0, 3.0), 0)
    for first in rng.integers(n // 10, 7 * n // 10, CUTS):
        times, places = samples.times[first:], samples.positions[first:]
        cut = {key: one[first:] for key, one in columns.items()}
        false += bool(settling_times(cut, times, places))
        since, tau = times - times[0], np.exp(rng.uniform(np.log(15), np.log(60)))
        for ranges in hits:
            off = ranges * np.ptp(cut["ph"]) * np.exp(-since / tau)
            hits[ranges] += "ph" in settling_times({**cut, "ph": cut["ph"] + off}, times, places)
    return {"false": f"{false} of {CUTS}"} | {f"{k:g} ranges": f"{v}" for k, v in hits.items()}


def bubbly(samples: Samples, rng: np.random.Generator) -> dict[str, str]:
    """Bubbles of 3 to 10 % for 15 to 300 s found from end to end, and water mistaken for them."""
    t = samples.times - samples.times[0]
    witnesses = [samples.values[key] for key in WITNESSES]
    out = {}
    for depth in (0.03, 0.04, 0.07, 0.1):
        found, wrong, fronts = 0, 0, 0
        for _ in range(BUBBLES):
            start, ramp = rng.uniform(60, t[-1] - 360), rng.uniform(0.5, 3)
            end = start + np.exp(rng.uniform(np.log(15), np.log(300)))
            shape = np.clip((t - start) / ramp, 0, 1) * np.clip((end - t) / ramp, 0, 1)
            wide = np.clip((t - start) / ramp / 4, 0, 1) * np.clip((end - t) / ramp / 4, 0, 1)
            clean = samples.values["specific_conductance_uscm"]
            noise = 1 + 0.1 * rng.normal(size=len(t))
            flags = bubbles(clean * (1 - depth * shape * noise), witnesses, samples.times)
            found += flags[shape > 0.5].mean() > 0.8
            wrong += int(flags[shape == 0].sum())
            warm = [witnesses[0] + wide, *witnesses[1:]]
            fronts += bool(bubbles(clean * (1 - depth * wide), warm, samples.times).any())
        out[f"{depth:.0%}"] = f"found {found}, wrong samples {wrong}, fronts {fronts} of {BUBBLES}"
    return out


def main() -> None:
    for path in sorted(Path(sys.argv[1]).glob("*.csv")):
        began = time.perf_counter()
        samples = samples_of(path)
        read_s = time.perf_counter() - began
        print(path.stem, f"{len(samples)} rows read in {read_s:.2f} s")
        print("  settling", settling(samples, np.random.default_rng(2026)))
        print("  bubbles ", bubbly(samples, np.random.default_rng(2026)))


if __name__ == "__main__":
    main()
