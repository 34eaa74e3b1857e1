"""A pretend firmware over UDP loopback sails our hull in lock-step."""

import json
import socket
import struct
import threading
from contextlib import contextmanager

import pytest

from grebe.core.errors import LinkError
from grebe.core.vessel import PRESETS
from grebe.links.physics import PhysicsServer
from grebe.simulation.physics import Physics

BOAT = PRESETS["blueboat"]


class Firmware:
    """The firmware's end of the line: one packet, then it waits for the answer."""

    def __init__(self, address, channels=16):
        self.frame, self._address = 0, address
        self._form, self._magic = f"<HHI{channels}H", {16: 18458, 32: 29569}[channels]
        self._rest = channels - 3
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(10.0)

    def __del__(self):
        self._socket.close()

    def send(self, data):
        self._socket.sendto(data, self._address)

    def packet(self, port, starboard):
        rest = [0] * self._rest
        return struct.pack(self._form, self._magic, 200, self.frame, port, 1500, starboard, *rest)

    def hears(self):
        return json.loads(self._socket.recv(2048))

    def hears_nothing(self):
        self._socket.settimeout(0.1)
        with pytest.raises(TimeoutError):
            self._socket.recv(2048)
        self._socket.settimeout(10.0)

    def ask(self, port=1500, starboard=1500):
        self.send(self.packet(port, starboard))
        answer = self.hears()
        self.frame += 1
        return answer


@contextmanager
def served():
    told, done = [], threading.Event()
    server = PhysicsServer(Physics(BOAT), port=0, tell=told.append)
    thread = threading.Thread(target=server.serve, args=(done.is_set,))
    thread.start()
    try:
        yield server, told
    finally:
        done.set()
        thread.join()


@pytest.mark.parametrize("channels", [16, 32])
def test_a_firmware_sails_the_hull_in_lock_step(channels):
    with served() as (server, told):
        firmware = Firmware(server.address, channels)
        for _ in range(1000):
            answer = firmware.ask(1900, 1900)
        assert answer["timestamp"] == pytest.approx(5.0)
        assert 0 < answer["velocity"][0] < BOAT.speed_max_mps
        assert told[0].startswith("the firmware at 127.0.0.1:")
        assert server.foreign == 0


def test_foreign_and_malformed_packets_are_passed_over():
    with served() as (server, _):
        firmware = Firmware(server.address)
        firmware.ask()
        whole = firmware.packet(1900, 1900)
        for wrong in (b"", b"\0", whole[:-1], whole + b"\0", b"\xff" * 40, b"x" * 5000):
            firmware.send(wrong)
        firmware.hears_nothing()
        assert firmware.ask()["timestamp"] == pytest.approx(0.01)
        assert server.foreign == 6


def test_a_packet_sent_again_is_answered_again():
    with served() as (server, _):
        firmware = Firmware(server.address)
        firmware.ask(1900, 1900)
        firmware.send(firmware.packet(1900, 1900))
        firmware.send(firmware.packet(1900, 1900))
        assert firmware.hears() == firmware.hears()


def test_restarted_firmware_finds_the_boat_where_it_began():
    with served() as (server, told):
        first = Firmware(server.address)
        for _ in range(200):
            first.ask(1900, 1900)
        again = Firmware(server.address)
        assert again.ask()["position"] == [0, 0, 0]
        assert len(told) == 2
        first.send(first.packet(1900, 1900))
        first.hears_nothing()
        assert again.ask()["timestamp"] == pytest.approx(0.01)


def test_a_port_that_is_taken_is_named():
    with served() as (server, _), pytest.raises(LinkError, match=str(server.address[1])):
        PhysicsServer(Physics(BOAT), port=server.address[1])
