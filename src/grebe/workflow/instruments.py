"""Instruments as users name them: `ADDRESS@PROFILE`, as in serial:/dev/ttyUSB0@ysi-exo."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import TypeVar

from grebe.core.errors import LinkError, UsageError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.io.store import SurveyFile
from grebe.links.base import Reading
from grebe.links.checks import Check, check
from grebe.links.instruments.instrument import Instrument, InstrumentSet
from grebe.links.instruments.profile import Profile, profile_named

_T = TypeVar("_T")
# How long an instrument is listened to before it counts as silent [s].
LISTEN_S = 12.0
# How long its line may take to open before a boat sets out [s].
OPEN_S = 3.0


def instrument_named(text: str, quantities: Quantities = BUILTIN) -> tuple[str, str, Profile]:
    """Return the address, the profile's name and the profile of `ADDRESS@PROFILE`.

    Raises `UsageError` for any other form, `InputError` for an unknown profile.
    """
    address, at, name = text.rpartition("@")
    if not at or not address or not name:
        raise UsageError(
            f"{text!r} is not ADDRESS@PROFILE, such as serial:/dev/ttyUSB0@ysi-exo.",
            settings=("instrument",),
        )
    return address, name, profile_named(name, quantities)


def boat_and_instrument(text: str) -> tuple[int | None, str]:
    """Split `2=ADDRESS@PROFILE` into the number of a fleet's boat and the instrument.

    The number is None if none is given.
    """
    boat, equals, rest = text.partition("=")
    return (int(boat), rest) if equals and boat.isdecimal() else (None, text)


@contextmanager
def instruments_at(
    texts: Sequence[str], quantities: Quantities = BUILTIN
) -> Generator[dict[int | None, InstrumentSet]]:
    """Open instruments within the block, and yield those of each boat of a fleet.

    The key is None if no boat is named.
    """
    of_boat: dict[int | None, list[tuple[str, str, Profile]]] = {}
    for boat, text in map(boat_and_instrument, texts):
        of_boat.setdefault(boat, []).append(instrument_named(text, quantities))
    with ExitStack() as opened:
        instrument_sets: dict[int | None, InstrumentSet] = {}
        for boat, named in of_boat.items():
            instrument_set = InstrumentSet(
                [Instrument(a, name, profile, quantities) for a, name, profile in named]
            )
            opened.callback(instrument_set.close)
            instrument_sets[boat] = instrument_set
        yield instrument_sets


def refuse_unopened(instrument_sets: Iterable[InstrumentSet]) -> None:
    """Refuse to set out with an instrument whose line cannot be opened: `LinkError` says which.

    One that is open and silent may be warming up. During a mission a line is reopened whenever it
    fails.
    """
    until_s = time.monotonic() + OPEN_S
    for one in [each for instrument_set in instrument_sets for each in instrument_set.each]:
        while not (one.is_open or one.is_broken) and time.monotonic() < until_s:
            time.sleep(0.02)
        if one.is_broken and not one.is_open:
            raise LinkError(
                f"{one.name} at {one.address} does not answer ({one.state}); plug it in, or sail "
                "without it."
            )


def of_one_boat(instrument_sets: Mapping[int | None, _T]) -> _T | None:
    """Return the instruments of a boat that sails alone; `UsageError` if they are a fleet's."""
    others = [boat for boat in instrument_sets if boat is not None]
    if others:
        raise UsageError(
            f"An instrument is assigned to boat {others[0]}, but only one boat sails; leave its "
            "number out.",
            settings=("instrument",),
        )
    return instrument_sets.get(None)


def of_fleet(instrument_sets: Mapping[int | None, _T], boats: int) -> dict[int, _T]:
    """Return the instruments of each boat of a fleet; `UsageError` if one names no valid boat."""
    found = {
        boat: instrument_set for boat, instrument_set in instrument_sets.items() if boat is not None
    }
    if None in instrument_sets or not all(1 <= boat <= boats for boat in found):
        raise UsageError(
            f"{boats} boats sail, from 1 to {boats}: say which of them has the instrument, as "
            "1=ADDRESS@PROFILE.",
            settings=("instrument",),
        )
    return found


def declare_quantities(
    file: SurveyFile, instrument_set: InstrumentSet, quantities: Quantities = BUILTIN
) -> None:
    """Declare what the instruments may measure and the file does not declare yet."""
    new = [key for key in instrument_set.keys if key not in file.quantities]
    if new:
        file.declare(quantities.subset(new))


def watch_instrument(
    text: str,
    on_reading: Callable[[Reading], None],
    on_note: Callable[[str], None],
    *,
    seconds: float | None = None,
    quantities: Quantities = BUILTIN,
) -> str:
    """Pass on readings as they come, and return the instrument's state at the end.

    It ends after `seconds`, or never for None.
    """
    address, name, profile = instrument_named(text, quantities)
    instrument = Instrument(address, name, profile, quantities)
    until_s = None if seconds is None else time.monotonic() + seconds
    try:
        while until_s is None or time.monotonic() < until_s:
            for _, message in instrument.notes():
                on_note(message)
            for reading in instrument.readings():
                on_reading(reading)
            time.sleep(0.05)
        return instrument.state
    finally:
        instrument.close()


def checks_of(text: str, quantities: Quantities = BUILTIN) -> Check:
    """Return the preflight item of an instrument: whether it speaks, and what it says."""
    address, name, profile = instrument_named(text, quantities)
    instrument = Instrument(address, name, profile, quantities)
    try:
        until_s = time.monotonic() + LISTEN_S
        heard: dict[str, float] = {}
        while not heard and time.monotonic() < until_s:
            for reading in instrument.readings():
                heard.update(reading.values)
            time.sleep(0.05)
        said = ", ".join(f"{key} {value:.6g}" for key, value in heard.items())
        return check(
            f"instrument {name}", said or instrument.state, holds=bool(heard),
            advice=f"check power, cable, line speed and the sonde's output. {profile.setting_up}",
        )  # fmt: skip
    finally:
        instrument.close()
