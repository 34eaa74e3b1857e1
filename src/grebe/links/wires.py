"""Wires that carry bytes to and from boats and instruments, by UDP, TCP or serial line.

An address is `udp:HOST:PORT` (listen there and answer the last sender), `udpout:HOST:PORT` (send to
that address), `tcp:HOST:PORT`, or `serial:DEVICE[:BAUD]`.
"""

from __future__ import annotations

import select
import socket
import time
from typing import Any, Protocol

from grebe.core.errors import LinkError

LARGEST_DATAGRAM = 65_535
CONNECT_S = 10.0
USUAL_BAUD, USUAL_FRAME = 57_600, "8N1"


class Wire(Protocol):
    """A connection to a boat that carries bytes, and has a clock.

    `for_others` is the address by which another process can reach the same boat while this wire is
    open; empty if none can.
    """

    @property
    def for_others(self) -> str:
        """See the class."""
        ...

    def now_s(self) -> float:
        """Time [s] on a clock that never runs back."""
        ...

    def send(self, data: bytes) -> None:
        """Send a message; one that cannot be sent is lost, as over radio."""
        ...

    def receive(self, timeout_s: float) -> bytes:
        """Return the received bytes, waiting at most `timeout_s`; empty if there are none."""
        ...

    def close(self) -> None:
        """Close the connection."""
        ...


class UdpWire:
    """Datagrams: listens on a port and answers the last sender, or speaks first to an address."""

    def __init__(self, host: str, port: int, *, speaks_first: bool = False) -> None:
        self._peer = (host, port) if speaks_first else None
        self._fixed = speaks_first
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("", 0) if speaks_first else (host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"Cannot listen on {host}:{port} ({error.strerror}); another program may be "
                "using the port."
            ) from error
        self._socket.setblocking(False)

    @property
    def for_others(self) -> str:
        """See `Wire`: any process may send datagrams to the peer."""
        return "" if self._peer is None else f"udpout:{self._peer[0]}:{self._peer[1]}"

    def now_s(self) -> float:
        """See `Wire`."""
        return time.monotonic()

    def send(self, data: bytes) -> None:
        """See `Wire`; before the first datagram has come there is no peer to answer."""
        if self._peer is None:
            return
        try:
            self._socket.sendto(data, self._peer)
        except OSError:
            return

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`."""
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            data, peer = self._socket.recvfrom(LARGEST_DATAGRAM)
        except OSError:
            return b""
        if not self._fixed:
            self._peer = peer
        return data

    def close(self) -> None:
        """See `Wire`."""
        self._socket.close()


class TcpWire:
    """A TCP stream; it is not reopened when the other side closes it."""

    def __init__(self, host: str, port: int) -> None:
        try:
            self._socket = socket.create_connection((host, port), CONNECT_S)
        except OSError as error:
            raise LinkError(f"Nothing answers at tcp:{host}:{port} ({error}).") from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    @property
    def for_others(self) -> str:
        """See `Wire`: a port may accept only one client."""
        return ""

    def now_s(self) -> float:
        """See `Wire`."""
        return time.monotonic()

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        try:
            self._socket.sendall(data)
        except BlockingIOError:
            return
        except OSError as error:
            raise LinkError(f"The TCP line broke ({error}).") from error

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`; `LinkError` if the other side has closed the stream."""
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            data = self._socket.recv(LARGEST_DATAGRAM)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"The TCP line broke ({error}).") from error
        if not data:
            raise LinkError("The autopilot closed the TCP line.")
        return data

    def close(self) -> None:
        """See `Wire`."""
        self._socket.close()


class SerialWire:
    """A serial line, using pyserial; `frame` is bits, parity and stop bits, as in 8N1."""

    def __init__(self, device: str, baud: int, frame: str = USUAL_FRAME) -> None:
        import serial

        self._errors: type[Exception] = serial.SerialException
        bits, parity, stops = int(frame[0]), frame[1], float(frame[2:])
        try:
            self._port: Any = serial.Serial(
                device, baud, bits, parity, stops, timeout=0, write_timeout=0.1
            )
        except (serial.SerialException, ValueError) as error:
            raise LinkError(f"The serial line {device} cannot be opened ({error}).") from error
        self._address = f"serial:{device}:{baud}"

    @property
    def for_others(self) -> str:
        """See `Wire`: a serial device can be opened twice."""
        return self._address

    def now_s(self) -> float:
        """See `Wire`."""
        return time.monotonic()

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        try:
            self._port.write(data)
        except (OSError, self._errors) as error:
            if "timeout" in str(error).lower():
                return
            raise LinkError(f"The serial line broke ({error}).") from error

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`."""
        try:
            self._port.timeout = max(0.0, timeout_s)
            first = self._port.read(1)
            return first + self._port.read(self._port.in_waiting) if first else b""
        except (OSError, self._errors) as error:
            raise LinkError(f"The serial line broke ({error}).") from error

    def close(self) -> None:
        """See `Wire`."""
        self._port.close()


def wire_at(address: str) -> Wire:
    """Open the wire at an address; `LinkError` if it is not an address or cannot be opened."""
    kind, _, rest = address.partition(":")
    if kind == "serial" and rest:
        device, _, baud = rest.partition(":")
        if not baud or baud.isdigit():
            return SerialWire(device, int(baud or USUAL_BAUD))
    host, _, port = rest.rpartition(":")
    if port.isdigit() and 0 < int(port) < 65_536:
        if kind in ("udp", "udpin", "udpout"):
            return UdpWire(host, int(port), speaks_first=kind == "udpout")
        if kind == "tcp":
            return TcpWire(host, int(port))
    raise LinkError(
        f"There is no wire {address!r}; give udp:HOST:PORT (to listen), udpout:HOST:PORT, "
        "tcp:HOST:PORT or serial:DEVICE:BAUD."
    )
