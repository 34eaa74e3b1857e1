"""Notes on the maps of a survey: what a user should know before they are used."""

from __future__ import annotations

from collections.abc import Sequence

from grebe.core.quantity import inline
from grebe.core.samples import Samples
from grebe.mapping.fields.joining import distinct
from grebe.mapping.quantity_map import QuantityMap
from grebe.report.data import ReportData


def sample_notes(data: ReportData) -> list[str]:
    """Return notes on readings of several outings, below zero, or that repeat others."""
    notes: list[str] = []
    count, pause_s = data.samples.outings()
    if count > 1:
        notes.append(
            f"the readings are of {count} outings, with a pause of up to {pause_s / 86_400:.1f} "
            "days between them; where outings meet, a difference may be one of time"
        )
    for one in data.maps:
        notes += _below_zero(data, one)
        repeats = _repeats(data.samples, one.quantity.key)
        if repeats:
            notes.append(
                f"{one.quantity.label}: {repeats} samples repeat the place and the reading of "
                "another, and count once with it"
            )
    return notes


def _below_zero(data: ReportData, one: QuantityMap) -> list[str]:
    below = data.below_zero(one)
    if below is None:
        return []
    name, unit = one.quantity.label, f" {one.quantity.unit}" * bool(one.quantity.unit)
    notes: list[str] = []
    if below.count:
        notes.append(
            f"{name}: {below.count} of {below.of} good readings are below 0, down to "
            f"{below.least:.3g}{unit}; no water is, so the sensor's zero may be off; they are "
            "mapped as they are"
        )
    if below.mapped_share:
        notes.append(
            f"{name}: the map is below 0 on {below.mapped_share:.1%} of its area, down to "
            f"{below.mapped_least:.2g}{unit}; read that as none: it is the sensor's zero or the "
            "map's error"
        )
    return notes


def _repeats(samples: Samples, key: str) -> int:
    """How many good readings repeat another at the same place."""
    good = samples.usable(key)
    return int(good.sum()) - len(distinct(samples.positions[good], samples.values[key][good]))


def change_notes(maps: Sequence[QuantityMap]) -> list[str]:
    """Return notes on water that changed, and on sensors that answered late.

    They concern only maps that show each place as it was measured.
    """
    notes: list[str] = []
    for one in maps:
        name, change = one.quantity.label, one.change
        if one.is_of_moment:
            continue
        if change.is_significant:
            unit = f" {one.quantity.unit}" if one.quantity.unit else ""
            notes.append(
                f"{name}: the water as a whole seems to have changed by {one.changed_by:.2g}{unit} "
                "during the survey; a map of one moment corrects for that"
            )
        if change.lag_s:
            notes.append(
                f"{name}: opposing lanes agree best at a delay of {change.lag_s:g} s; a map of one "
                "moment corrects for that, and for the smoothing of a slow sensor; or record it as "
                "the sensor's lag"
            )
    return notes


def together_notes(maps: Sequence[QuantityMap], together: Sequence[str]) -> list[str]:
    """Return a note for each quantity on the gain of mapping some together."""
    labels = {one.quantity.key: inline(one.quantity.label) for one in maps}
    notes: list[str] = []
    for one in maps:
        if one.quantity.key not in together:
            continue
        name, told = one.quantity.label, one.model.companions
        if told is None:
            notes.append(
                f"{name}: mapped alone: land is between the readings, or it or the quantities to "
                "map with it have too few good readings"
            )
            continue
        with_ = " and ".join(
            labels.get(key, key) + (f" (correlation {correlation:.2f})" if correlation else "")
            for key, correlation in zip(told.names, told.correlations, strict=True)
        )
        notes.append(
            f"{name}: mapped together with {with_}, which reduces the median standard deviation "
            f"by {told.spared:.0%}"
            if told.heeded
            else f"{name}: mapped alone: {with_} adds next to nothing to its own readings"
        )
    return notes
