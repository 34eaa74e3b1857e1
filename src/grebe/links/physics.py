"""A physics server for ArduPilot's firmware: UDP packets in, lines of JSON back to the sender."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress

from grebe.core.errors import LinkError
from grebe.simulation.physics import Physics, ServoPacket, read_packet

PORT = 9002
LARGEST_PACKET = 2048
# How often an idle server checks whether to stop [s].
LOOK_S = 0.2
# Another firmware takes over only if it begins anew, or the previous one has been silent for this
# long [s].
SILENT_S = 2.0

Address = tuple[str, int]


class PhysicsServer:
    """Serves one firmware at a time; `tell` receives a message, in words, when one starts.

    Foreign packets, late copies, and a second firmware beside the first get no answer. Raises
    `LinkError` if the port is in use.
    """

    def __init__(
        self,
        physics: Physics,
        host: str = "127.0.0.1",
        port: int = PORT,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._physics = physics
        self._tell = tell
        self._firmware: Address | None = None
        self._heard_s = 0.0
        self.foreign = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"Physics cannot be served at {host}:{port} ({error.strerror or error}); another "
                "program may be using the port."
            ) from error
        self._socket.settimeout(LOOK_S)

    @property
    def address(self) -> Address:
        """The address on which the server listens."""
        host, port = self._socket.getsockname()
        return host, port

    def serve(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Answer packets until `stopped` returns true or an exception is raised; then close the
        port.
        """
        with self._socket:
            while not stopped():
                try:
                    data, sender = self._socket.recvfrom(LARGEST_PACKET)
                except OSError:
                    # A time-out, or an error because the firmware has closed its port.
                    continue
                self._take(data, sender)

    def _take(self, data: bytes, sender: Address) -> None:
        packet = read_packet(data)
        if packet is None or not self._admits(packet, sender):
            self.foreign += 1
            return
        starts = self._physics.starts
        answer = self._physics.answer(packet)
        if self._physics.starts > starts:
            rate = packet.frame_rate_hz
            self._tell(
                f"the firmware at {sender[0]}:{sender[1]} has connected ({rate} frames a second)"
            )
        if answer is not None:
            with suppress(OSError):
                self._socket.sendto(answer, sender)

    def _admits(self, packet: ServoPacket, sender: Address) -> bool:
        """Whether a packet is from the firmware that is served, or one that takes its place."""
        now_s = time.monotonic()
        if sender != self._firmware:
            quiet = now_s - self._heard_s > SILENT_S
            if self._firmware is not None and packet.frame > 0 and not quiet:
                return False
            if self._firmware is not None:
                self._physics.restart()
            self._firmware = sender
        self._heard_s = now_s
        return True
