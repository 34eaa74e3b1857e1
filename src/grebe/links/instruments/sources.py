"""Open lines to instruments: lines of text over a wire, or Modbus registers. If an instrument falls
silent, its reader closes the line and opens it again; see `instrument`.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import Any, Protocol

from grebe.core.errors import InputError, LinkError
from grebe.core.quantities import Quantities
from grebe.links.instruments.decoding import Counts, DecodedReading, RegisterDecoder, TextDecoder
from grebe.links.instruments.profile import Profile, is_frame
from grebe.links.wires import SerialWire, Wire, wire_at

# How long one read of the line waits; a request to end waits no longer than this [s].
LOOK_S = 0.2
# A line longer than this is noise, from a wrong baud rate or a binary protocol [bytes].
LONGEST_LINE = 4096
# How long to wait for an answer to a question before the readings [s].
ANSWER_S = 1.0
ADDRESSES = (
    "serial:DEVICE[:BAUD[:8N1]], udp:HOST:PORT (to listen), udpout:, tcp:HOST:PORT or file:PATH"
)

Stopped = Callable[[], bool]


class InstrumentSource(Protocol):
    """An open line to an instrument; `counts` are those of what came over it."""

    @property
    def counts(self) -> Counts:
        """See the class."""
        ...

    def readings(self, stopped: Stopped) -> Generator[DecodedReading | None]:
        """Yield readings as they come, and None after a short time without any, until `stopped`.

        Raises `LinkError` or `OSError` if the line breaks.
        """
        ...

    def close(self) -> None:
        """Close the line."""
        ...


def open_source(address: str, profile: Profile, quantities: Quantities) -> InstrumentSource:
    """Open the line to an instrument; `LinkError` if that fails."""
    if profile.modbus is not None:
        return ModbusSource(address, profile, quantities)
    return LineSource(_wire(address, profile), profile, quantities)


def _wire(address: str, profile: Profile) -> Wire:
    kind, _, rest = address.partition(":")
    if kind == "serial" and rest:
        return SerialWire(*_serial(address, profile))
    if kind == "file" and rest:
        return FileTail(Path(rest))
    if kind not in ("udp", "udpin", "udpout", "tcp"):
        raise LinkError(f"There is no instrument line {address!r}; give {ADDRESSES}.")
    return wire_at(address)


class FileTail:
    """A wire that reads what is appended to a file, such as a logger's own file, from now on."""

    for_others = ""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = path.open("rb")
            self._file.seek(0, 2)
        except OSError as error:
            raise LinkError(f"{path} cannot be read ({error.strerror}).") from None

    def now_s(self) -> float:
        """See `Wire`."""
        return time.monotonic()

    def send(self, data: bytes) -> None:
        """Do nothing: a file takes no questions."""

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`; a file that was truncated is read from its beginning."""
        data = self._file.read()
        if not data:
            if self._path.stat().st_size < self._file.tell():
                self._file.seek(0)
            time.sleep(timeout_s)
        return data

    def close(self) -> None:
        """See `Wire`."""
        self._file.close()


class LineSource:
    """Reads lines of text, as they come or as they are requested."""

    def __init__(self, wire: Wire, profile: Profile, quantities: Quantities) -> None:
        assert profile.text is not None
        self._wire, self._text = wire, profile.text
        self._decoder = TextDecoder(profile, quantities)
        self._part = b""

    @property
    def counts(self) -> Counts:
        """See `InstrumentSource`."""
        return self._decoder.counts

    def readings(self, stopped: Stopped) -> Generator[DecodedReading | None]:
        """See `InstrumentSource`."""
        for question in self._text.setup:
            self._wire.send(question.encode())
            self._answers(stopped, lambda _: False)
        if self._text.list_codes:
            self._wire.send(self._text.list_codes.encode())
            if not self._answers(stopped, self._decoder.list_codes):
                raise LinkError("The instrument does not say which values it sends.")
        next_s = self._wire.now_s()
        while not stopped():
            if self._text.ask and self._wire.now_s() >= next_s:
                next_s = max(next_s + self._text.every_s, self._wire.now_s())
                self._wire.send(self._text.ask.encode())
            lines = self._lines()
            yield from (
                decoded for decoded in map(self._decoder.take, lines) if decoded is not None
            )
            if not lines:
                yield None

    def close(self) -> None:
        """See `InstrumentSource`."""
        self._wire.close()

    def _answers(self, stopped: Stopped, heeded: Callable[[bytes], bool]) -> bool:
        """Whether one of the lines within `ANSWER_S` is the expected answer."""
        until_s = self._wire.now_s() + ANSWER_S
        while self._wire.now_s() < until_s and not stopped():
            lines = self._lines()
            if any(heeded(line) for line in lines):
                return True
        return False

    def _lines(self) -> list[bytes]:
        """Return the lines that are complete by now; an endless line is dropped, and counted."""
        wait_s = min(LOOK_S, self._text.every_s) if self._text.ask else LOOK_S
        data = self._part + self._wire.receive(wait_s)
        *lines, self._part = data.replace(b"\r", b"\n").split(b"\n")
        if len(self._part) > LONGEST_LINE:
            self._part = b""
            self._decoder.counts.damaged += 1
        return [line for line in lines if line.strip()]


class ModbusSource:
    """Reads registers over Modbus RTU on a serial line, or over TCP."""

    def __init__(self, address: str, profile: Profile, quantities: Quantities) -> None:
        assert profile.modbus is not None
        self._modbus = profile.modbus
        self._decoder = RegisterDecoder(profile, quantities)
        self._client = _modbus_client(address, profile)
        if not self._client.connect():
            raise LinkError(f"Nothing answers at {address}; check the line and its speed.")

    @property
    def counts(self) -> Counts:
        """See `InstrumentSource`."""
        return self._decoder.counts

    def readings(self, stopped: Stopped) -> Generator[DecodedReading | None]:
        """See `InstrumentSource`."""
        next_s = time.monotonic()
        while not stopped():
            wait_s = next_s - time.monotonic()
            if wait_s > 0:
                time.sleep(min(wait_s, LOOK_S))
                continue
            next_s = max(next_s + self._modbus.every_s, time.monotonic())
            try:
                yield self._measure()
            except _NoAnswerError:
                self._decoder.counts.damaged += 1
                yield None

    def close(self) -> None:
        """See `InstrumentSource`."""
        self._client.close()

    def _measure(self) -> DecodedReading | None:
        modbus = self._modbus
        for one in modbus.write:
            self._asked(self._client.write_register, one.register, one.value)
        time.sleep(modbus.wait_s)
        return self._decoder.take(self._read, self._as_float)

    def _read(self, register: int, count: int) -> Sequence[int]:
        answer = self._asked(self._client.read_holding_registers, register, count=count)
        if len(answer.registers) != count:
            raise _NoAnswerError
        return answer.registers

    def _asked(self, question: Callable[..., Any], register: int, *given: int, **named: int) -> Any:
        """Return the answer to a question about a register; `_NoAnswerError` if there is none."""
        from pymodbus.exceptions import ModbusException

        try:
            answer = question(
                register - self._modbus.first, *given, device_id=self._modbus.device, **named
            )
        except ModbusException:
            raise _NoAnswerError from None
        if answer.isError():
            raise _NoAnswerError
        return answer

    def _as_float(self, words: Sequence[int]) -> float:
        high, low = words if self._modbus.order == "ABCD" else reversed(words)
        return float(struct.unpack(">f", struct.pack(">HH", high, low))[0])


class _NoAnswerError(Exception):
    """The instrument did not answer, or incompletely, or with a wrong sum."""


def _serial(address: str, profile: Profile) -> tuple[str, int, str]:
    """Return device, baud and frame, from the address if given there, else from the profile."""
    device, _, rest = address.removeprefix("serial:").partition(":")
    baud, _, frame = rest.partition(":")
    if (baud and not baud.isdigit()) or (frame and not is_frame(frame)):
        raise LinkError(f"There is no instrument line {address!r}; give {ADDRESSES}.")
    return device, int(baud or profile.serial.baud), frame or profile.serial.frame


def _modbus_client(address: str, profile: Profile) -> Any:
    try:
        from pymodbus import FramerType
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient
    except ImportError:
        raise InputError(
            "A Modbus instrument needs pymodbus; install grebe with its extra 'instruments'."
        ) from None
    kind, _, rest = address.partition(":")
    if kind == "serial" and rest:
        device, baud, frame = _serial(address, profile)
        return ModbusSerialClient(
            device,
            baudrate=baud,
            bytesize=int(frame[0]),
            parity=frame[1],
            stopbits=int(frame[2]),
            timeout=0.5,
            retries=0,
        )
    host, _, port = rest.rpartition(":")
    if kind in ("tcp", "modbus-tcp") and port.isdigit():
        # A plain TCP port leads to a serial line, and carries its frames.
        framer = FramerType.RTU if kind == "tcp" else FramerType.SOCKET
        return ModbusTcpClient(host, port=int(port), framer=framer, timeout=0.5, retries=0)
    raise LinkError(
        "A Modbus instrument's address is serial:DEVICE[:BAUD], tcp:HOST:PORT or "
        f"modbus-tcp:HOST:PORT, not {address!r}."
    )
