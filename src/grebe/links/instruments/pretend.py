"""Pretend instruments for tests and rehearsals, which speak as a profile describes.

A pretend instrument answers on a pseudo-terminal, which can be opened as a serial line, or sends
its lines by UDP. Its "measurements" come from a function of time.
"""

from __future__ import annotations

import math
import os
import pty
import select
import socket
import struct
import threading
import time
import tty
from collections.abc import Callable, Mapping
from typing import Protocol

from grebe.core.errors import LinkError
from grebe.core.quantities import BUILTIN
from grebe.core.units import conversion, unit_of
from grebe.links.instruments.decoding import xor_sum
from grebe.links.instruments.profile import Measured, Profile

# Values by quantity, in the registry's units, at a time [s].
Truth = Callable[[float], Mapping[str, float]]
POLL_S = 0.02


def typical_water(time_s: float) -> dict[str, float]:
    """Return plausible values of every quantity, which vary a little with time."""
    wave = math.sin(time_s / 20.0)
    return {
        key: one.lake.mean + one.lake.sd * wave
        for key, one in BUILTIN.items()
        if one.lake is not None
    }


class SimulatedInstrument(Protocol):
    """What an instrument sends, in answer and by itself."""

    def receive(self, data: bytes) -> bytes:
        """Return the answer to what came over the line; empty if there is none."""
        ...

    def due(self) -> bytes:
        """Return what is due to be sent unrequested."""
        ...


class SimulatedTextInstrument:
    """An instrument that sends lines; `period_s` is the time between unrequested lines."""

    def __init__(self, profile: Profile, truth: Truth, period_s: float = 1.0) -> None:
        assert profile.text is not None
        self._profile, self._text, self._truth = profile, profile.text, truth
        self._period_s, self._next_s = period_s, 0.0
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        """See `SimulatedInstrument`."""
        *request, self._received = (self._received + data).split(b"\r")
        return b"".join(self._answer(one.decode() + "\r") for one in request)

    def due(self) -> bytes:
        """See `SimulatedInstrument`."""
        now_s = time.monotonic()
        if self._text.ask or now_s < self._next_s:
            return b""
        self._next_s = now_s + self._period_s
        return self.line().encode() + b"\r\n"

    def line(self) -> str:
        """Return a line of the newest values."""
        text, codes = self._text, self._profile.codes
        values = self._truth(time.monotonic())
        if text.pairs_from:
            pairs = [f"{code},{_in(one, values):.2f}" for code, one in codes.items()]
            return self._summed(",".join([text.begins.rstrip(","), *pairs]))
        if text.coded:
            code, one = next(iter(codes.items()))
            fields = [text.begins.rstrip(","), "01", code, f"{_in(one, values):.5f}", "0.012"]
            unit = one.unit.replace("µ", "u")
            return self._summed(",".join([*fields, unit, "", "", "", "C02", ""]))
        if text.list_codes:
            return " ".join(f"{_in(one, values):.3f}" for one in codes.values())
        width = max(one.at for one in text.columns)
        fields = ["0"] * width
        for one in text.columns:
            what = Measured(quantity=one.quantity, unit=one.unit)
            fields[one.at - 1] = f"{_in(what, values):.4f}"
        return (text.delimiter or " ").join(fields)

    def _answer(self, request: str) -> bytes:
        if request == self._text.ask:
            return self.line().encode() + b"\r\n"
        if request == self._text.list_codes:
            return " ".join(self._profile.codes).encode() + b"\r\n"
        return b"OK\r\n"

    def _summed(self, body: str) -> str:
        return f"{body}*{xor_sum(body):02X}"


class SimulatedModbusInstrument:
    """An instrument with registers: function 3 reads them, and 6 and 16 write them."""

    def __init__(self, profile: Profile, truth: Truth) -> None:
        assert profile.modbus is not None
        self._profile, self._modbus, self._truth = profile, profile.modbus, truth
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        """See `SimulatedInstrument`."""
        self._received += data
        length = 8
        if len(self._received) > 6 and self._received[1] == 16:
            length = 9 + self._received[6]
        if len(self._received) < length:
            return b""
        asked, self._received = self._received[:length], b""
        if crc16(asked[:-2]) != asked[-2:] or asked[0] != self._modbus.device:
            return b""
        body = self._answer(asked)
        return body + crc16(body)

    def due(self) -> bytes:
        """See `SimulatedInstrument`: an instrument with registers only answers."""
        return b""

    def _answer(self, asked: bytes) -> bytes:
        device, function, start, count = struct.unpack(">BBHH", asked[:6])
        if function != 3:
            return asked[:6]
        registers = self.registers()
        words = [registers.get(start + i, 0) for i in range(count)]
        return struct.pack(f">BBB{count}H", device, function, 2 * count, *words)

    def registers(self) -> dict[int, int]:
        """Return the words by the register number that is sent over the line."""
        modbus, codes = self._modbus, self._profile.codes
        values, held = self._truth(time.monotonic()), dict[int, int]()
        for one in modbus.values:
            what = Measured(quantity=one.quantity, unit=one.unit)
            self._put(held, one.register, _in(what, values))
        for at, (code, one) in zip(modbus.blocks, codes.items(), strict=False):
            units = {name: number for number, name in self._profile.units.items()}
            self._put(held, at, _in(one, values))
            unit = units.get(one.unit or BUILTIN[one.quantity].unit, "0")
            held |= {at - modbus.first + 2: int(code), at - modbus.first + 3: int(unit)}
        if modbus.listed is not None:
            for i, (code, one) in enumerate(codes.items()):
                held[modbus.listed.codes + i], held[modbus.listed.states + i] = int(code), 0
                self._put(held, modbus.listed.values + 2 * i, _in(one, values))
        return held

    def _put(self, held: dict[int, int], register: int, value: float) -> None:
        words = struct.unpack(">HH", struct.pack(">f", value))
        ordered = words if self._modbus.order == "ABCD" else words[::-1]
        at = register - self._modbus.first
        held[at], held[at + 1] = ordered


def simulated_instrument(
    profile: Profile, truth: Truth = typical_water, period_s: float = 1.0
) -> SimulatedInstrument:
    """Return a simulated instrument of this kind."""
    if profile.modbus is not None:
        return SimulatedModbusInstrument(profile, truth)
    return SimulatedTextInstrument(profile, truth, period_s)


class PretendSerial:
    """An instrument on a pseudo-terminal; `device` can be opened as a serial line."""

    def __init__(self, instrument: SimulatedInstrument) -> None:
        self._instrument = instrument
        self._ours, theirs = pty.openpty()
        tty.setraw(theirs)
        self.device = os.ttyname(theirs)
        # Held open, so that readers can come and go.
        self._theirs = theirs
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the terminal, as if the cable were pulled."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._thread.join(2.0)
        os.close(self._ours)
        os.close(self._theirs)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            ready, _, _ = select.select([self._ours], [], [], POLL_S)
            answer = self._instrument.receive(os.read(self._ours, 4096)) if ready else b""
            answer += self._instrument.due()
            if answer:
                os.write(self._ours, answer)


class PretendUdp:
    """An instrument that sends its lines to HOST:PORT."""

    def __init__(self, instrument: SimulatedInstrument, address: str) -> None:
        host, _, port = address.rpartition(":")
        if not host or not port.isdigit():
            raise LinkError(f"{address!r} is not a HOST:PORT to send to, such as 127.0.0.1:4001.")
        self._instrument, self._to = instrument, (host, int(port))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop sending."""
        self._stopping.set()
        self._thread.join(2.0)
        self._socket.close()

    def _serve(self) -> None:
        while not self._stopping.wait(POLL_S):
            decoded = self._instrument.due()
            if decoded:
                self._socket.sendto(decoded, self._to)


def crc16(data: bytes) -> bytes:
    """Return the CRC of Modbus RTU: polynomial 0xA001 reflected, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


def _in(what: Measured, values: Mapping[str, float]) -> float:
    """Return a quantity's value in the instrument's own unit."""
    wanted = BUILTIN[what.quantity].unit
    turns = (
        conversion(unit_of(what.unit) or what.unit, wanted, what.quantity) if what.unit else None
    )
    value = values.get(what.quantity, 0.0)
    return value if turns is None else (value - turns.offset) / turns.factor
