"""The settings of an NMEA boat, from its URL: `udp:0.0.0.0:10110?out=udp:127.0.0.1:5005`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from urllib.parse import parse_qsl

from grebe.core.errors import LinkError, UsageError
from grebe.links.wires import SerialWire, UdpWire, Wire

USUAL_BAUD = 4800
ADDRESSES = "udp:HOST:PORT or serial:DEVICE@BAUD"


@dataclass(frozen=True, kw_only=True)
class NmeaSettings:
    """The settings of an NMEA boat.

    `source` is the address from which sentences come, and `out` the one to which thrusts go; if
    `out` is empty, thrusts go to `source`. `late_s` is the receiver's own latency. `variation_deg`
    is the compass's variation, positive to the east, for use if no sentence gives it. `find_s` is
    how long to wait for a first position and heading. After `silence_s` without a sentence the boat
    counts as lost.

    Raises `UsageError` for impossible values.
    """

    source: str
    out: str = ""
    late_s: float = 0.0
    variation_deg: float | None = None
    find_s: float = 60.0
    silence_s: float = 15.0

    def __post_init__(self) -> None:
        if not 0 <= self.late_s <= 5:
            raise UsageError(f"A receiver's delay must be 0 to 5 s, not {self.late_s:g} s.")
        if self.variation_deg is not None and not abs(self.variation_deg) <= 180:
            raise UsageError(
                f"A compass's variation must be -180 to 180 degrees, not {self.variation_deg:g}."
            )
        if not (0 < self.find_s < math.inf and 0 < self.silence_s < math.inf):
            raise UsageError("The time-outs of an NMEA line must be above 0 s.")
        if not self.out and self.source.startswith("udp:"):
            raise UsageError(
                "There is no address for the thrusts: a boat received by udp: needs "
                "?out=udp:HOST:PORT or ?out=serial:DEVICE@BAUD."
            )
        _parts(self.source)
        if self.out:
            _parts(self.out)


NUMBERS = {"late": "late_s", "variation": "variation_deg", "find": "find_s", "silence": "silence_s"}


def settings_of(rest: str) -> NmeaSettings:
    """Read the part of a URL after `nmea:`; `LinkError` or `UsageError` says what is wrong."""
    source, _, query = rest.partition("?")
    out, numbers = "", {}
    for key, value in parse_qsl(query, keep_blank_values=True):
        if key == "out":
            out = value
        elif key in NUMBERS:
            numbers[NUMBERS[key]] = _number(key, value)
        else:
            known = ", ".join(["out", *NUMBERS])
            raise LinkError(f"nmea: there is no setting {key!r}; choose from {known}.")
    return NmeaSettings(source=source, out=out, **numbers)


def open_wire(address: str, *, speaks_first: bool) -> Wire:
    """Open an address, to listen there or to send to it; `LinkError` if that is impossible."""
    kind, place, number = _parts(address)
    if kind == "serial":
        return SerialWire(place, number)
    return UdpWire(place, number, speaks_first=speaks_first)


def _number(key: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise LinkError(f"nmea: {key}={value} is not a number.") from None


def _parts(address: str) -> tuple[str, str, int]:
    """Return the kind, the host or device, and the port or speed of an address."""
    kind, _, rest = address.partition(":")
    if kind == "serial" and rest:
        device, at, baud = rest.rpartition("@")
        if not at:
            return kind, rest, USUAL_BAUD
        if device and baud.isdigit() and int(baud) > 0:
            return kind, device, int(baud)
    host, _, port = rest.rpartition(":")
    if kind == "udp" and host and port.isdigit() and 0 < int(port) < 65_536:
        return kind, host, int(port)
    raise LinkError(f"There is no NMEA line {address!r}; give {ADDRESSES}.")
