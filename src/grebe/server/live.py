"""Missions under way, and the tabs that watch them: each gets a snapshot, then the changes.

A tab that is too slow for the changes gets a new snapshot instead of a growing queue. The state of
a survey is read from its file and kept up to date by the messages of the mission's own process;
when either is gone, the other still has it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
import sys
from collections.abc import AsyncGenerator
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool

from grebe.core.errors import InputError, LinkError
from grebe.server import library, views
from grebe.server.fleet_state import carried_on, part_of, together
from grebe.server.mission_delta import iso
from grebe.server.mission_request import Voyage
from grebe.server.mission_socket import live_path
from grebe.server.tabs import Lease, Message, Past, Tab, encoded_message

KEEP_S = 5.0
# Longest wait for a new mission; the first one compiles its controller [s].
START_S = 180.0
# Shortest time between two announcements of a new map to the page [s].
MAP_EACH_S = 5.0
TRACK_KEPT, SAMPLES_KEPT = 20_000, 3_000
# A placeholder without text: each tab's own lease message is made when it is sent.
LEASE = Message("lease", b"")
UNDER_WAY = ("running", "paused", "returning")


class MissionWatch:
    """One survey: its state, its tabs, and the connection to its mission while there is one."""

    def __init__(self, survey_id: str, path: Path, lease: Lease) -> None:
        self.survey_id, self.path, self.lease = survey_id, path, lease
        self.tabs: list[Tab] = []
        self._past = Past()
        self.state: dict[str, Any] = {}
        self.map_version = 0
        self._map_sent_s = 0.0
        self._writer: asyncio.StreamWriter | None = None
        self._listening: asyncio.Task[None] | None = None
        self._lock = asyncio.Lock()

    @property
    def under_way(self) -> bool:
        """Whether a mission is connected."""
        return self._writer is not None

    async def ready(self) -> None:
        """Connect to the mission, if there is one; read the file if there is none, or no state."""
        async with self._lock:
            if self._writer is None:
                await self._connect()
            if not self.state or not self.under_way:
                await self._read()

    async def _read(self) -> None:
        state = await run_in_threadpool(views.snapshot, self.survey_id, self.path)
        if self.under_way:
            state["status"] |= {"state": "running", "doing": "surveying"}
            carried_on(self.state, state)
        self.state = state

    async def _connect(self) -> None:
        try:
            address = json.loads(live_path(self.path).read_text(encoding="ascii"))
            reader, writer = await asyncio.wait_for(
                asyncio.open_connection("127.0.0.1", int(address["port"]), limit=2**22), 2.0
            )
            writer.write(f"{address['key']}\n".encode())
            await writer.drain()
        except (OSError, ValueError, KeyError, TypeError, TimeoutError):
            return
        self._writer = writer
        await self._read()
        self._listening = asyncio.create_task(self._listen(reader))

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        try:
            while line := await reader.readline():
                message = json.loads(line)
                self._apply(message)
                if message.get("revised"):
                    await self._read()
                    self._send_snapshots()
        except (OSError, ValueError):
            pass
        self._writer = None
        # The mission has written everything once its .live file is gone.
        for _ in range(50):
            if not live_path(self.path).exists():
                break
            await asyncio.sleep(0.1)
        with contextlib.suppress(Exception):
            await self._read()
        self.map_version += 1
        self._send_snapshots()

    def _send_snapshots(self) -> None:
        self._past.forget()
        for tab in self.tabs:
            tab.send_snapshot()

    def _send(self, kind: str, what: Any) -> None:
        message = self._past.add(kind, what)
        for tab in self.tabs:
            tab.send(message)

    def _apply(self, message: dict[str, Any]) -> None:
        """Apply a message of a mission, or of one boat of a fleet, and pass it on to the tabs."""
        state = self.state
        if state["begins"] is None:
            state["begins"] = message["time"]
        zero: float = state["begins"]
        one = part_of(state, message.get("boat"))
        delta: dict[str, Any] = {"t": message["time"] - zero, "heard": message["heard"]}
        for name in ("estimate", "thrusts", "horizon", "current"):
            if name in message:
                one[name] = delta[name] = message[name]
        self._apply_lists(message, delta, zero)
        one["status"] |= message["status"]
        status = state["status"]
        if one is not state:
            delta |= {"boat": message["boat"], "own": one["status"]}
            status |= together(state["boats"])
        status["time"] = iso(datetime.fromtimestamp(message["time"], UTC))
        status["t"] = delta["t"]
        status["coverage"] = status["reached"] / max(1, status["targets"])
        delta["status"] = status
        self._send("delta", delta)
        if message.get("samples") and message["time"]:
            self._send_map()

    def _apply_lists(self, message: dict[str, Any], delta: dict[str, Any], zero: float) -> None:
        state = self.state
        one = part_of(state, message.get("boat"))
        track = [point for point in message.get("track", ()) if point[0] > one["last"]]
        if track:
            one["track"] = [*one["track"], *track][-TRACK_KEPT:]
            delta["track"] = [[point[0] - zero, *point[1:]] for point in track]
        shown = {quantity["id"] for quantity in state["quantities"]}
        places = [i for i, key in enumerate(state["order"]) if key in shown]
        # Samples sent while the file was being read are also in the file.
        samples: list[Any] = [
            [at, lon, lat, [values[i] for i in places]]
            for at, lon, lat, values in message.get("samples", ())
            if at > one["sampled"]
        ]
        if samples:
            one["samples"] = [*one["samples"], *samples][-SAMPLES_KEPT:]
            state["status"]["samples"] += len(samples)
            delta["samples"] = [[each[0] - zero, *each[1:]] for each in samples]
        if message.get("targets"):
            delta["targets"] = self._apply_targets(message, counts=one is not state)
        if message.get("events"):
            state["events"] = [*state["events"], *message["events"]][-views.LOG_LINES :]
            delta["events"] = [_event_since(event, zero) for event in message["events"]]

    def _apply_targets(self, message: dict[str, Any], *, counts: bool) -> list[Any]:
        """Apply the changes of targets and return them as [number, state]. A boat of a fleet counts
        only its own targets, so with `counts` the survey's count is updated here.
        """
        reached: set[int] = {seq for seq, word in message["targets"] if word == "reached"}
        changes: list[Any] = [
            *([seq, "open"] for seq in message.get("left", ()) if self._is_current(seq)),
            *message["targets"],
        ]
        changes = [one for one in changes if one[1] == "reached" or one[0] not in reached]
        targets = self._by_number()
        # A message from before the file was read must not undo a target that the file has reached.
        known = {seq for seq, target in targets.items() if target["state"] == "reached"}
        changes = [one for one in changes if one[0] not in known]
        for seq, word in changes:
            if seq in targets:
                if counts and word == "reached" and targets[seq]["state"] != "reached":
                    self.state["status"]["reached"] += 1
                targets[seq]["state"] = word
        return changes

    def _is_current(self, seq: int) -> bool:
        return self._by_number().get(seq, {}).get("state") == "current"

    def _by_number(self) -> dict[int, dict[str, Any]]:
        """The targets by their numbers, which after a revision differ from their positions."""
        return {one["seq"]: one for one in self.state["targets"]}

    def _send_map(self) -> None:
        now = asyncio.get_running_loop().time()
        if now - self._map_sent_s < MAP_EACH_S:
            return
        self._map_sent_s = now
        self.map_version += 1
        self._send("map", {"quantity": "", "version": self.map_version})

    def snapshot(self, tab: str) -> dict[str, Any]:
        """The complete state, as sent to a tab."""
        state = self.state
        zero = state["begins"] or 0.0
        last = max([state["last"], *(one["last"] for one in state["boats"])])
        return {
            **_public_state(state, zero),
            "boats": [_public_state(one, zero) for one in state["boats"]],
            "events": [_event_since(event, zero) for event in state["events"]],
            "status": {"t": max(0.0, last - zero), **state["status"]},
            "lease": self.lease.seen_by(tab),
            "map_version": self.map_version,
        }

    async def order(self, command: str) -> None:
        """Pass an order on to the mission; raises `LinkError` if none is under way."""
        await self.ready()
        if self._writer is None:
            raise LinkError("This survey is not under way, so there is no boat to command.")
        self._writer.write(f"{command}\n".encode())
        await self._writer.drain()

    async def begin(self, voyage: Voyage) -> None:
        """Start a mission in a process of its own, and wait until it is connected."""
        await self.ready()
        await self._ended()
        live_path(self.path).unlink(missing_ok=True)
        log = self.path.with_name(self.path.name + ".log")
        with log.open("w", encoding="utf-8") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "grebe.server.boat", self.path, json.dumps(asdict(voyage))],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )
        loop = asyncio.get_running_loop()
        end = loop.time() + START_S
        while not live_path(self.path).exists():
            if process.poll() is not None:
                text = log.read_text(encoding="utf-8").strip().splitlines()
                raise InputError(text[-1] if text else "The mission ended before it started.")
            if loop.time() > end:
                raise LinkError("The mission did not start within three minutes.")
            await asyncio.sleep(0.05)
        # Read the file before connecting, so that no listener finds an empty state.
        await self._read()
        await self.ready()
        self.state["status"] |= {"rate": voyage.rate, "link": voyage.link}
        self._send_snapshots()

    async def _ended(self) -> None:
        """Wait until a finished mission disconnects; raise `InputError` if one is under way."""
        for _ in range(200):
            if not self.under_way:
                return
            if self.state["status"]["state"] in UNDER_WAY:
                break
            await asyncio.sleep(0.1)
        raise InputError("This survey is already under way.")

    async def stream(self, tab: Tab, last: str = "") -> AsyncGenerator[bytes]:
        """The messages to a tab as server-sent events: a snapshot, then the changes. If `last`, the
        number of the last message that it received, is given, the messages since then replace the
        snapshot, as long as they are all kept.
        """
        await self.ready()
        self.tabs.append(tab)
        try:
            missed = self._past.since(last)
            if missed is None:
                yield self._all(tab)
            else:
                yield b"".join(message.text for message in (*missed, self._lease_of(tab)))
            while True:
                try:
                    message = await asyncio.wait_for(tab.queue.get(), KEEP_S)
                except TimeoutError:
                    if not self.under_way:
                        await self._reconnect(tab)
                    yield b": keep\n\n"
                    continue
                if tab.behind:
                    tab.catch_up()
                    yield self._all(tab)
                elif message.kind == "lease":
                    yield self._lease_of(tab).text
                elif message.text:
                    yield message.text
        finally:
            self.tabs.remove(tab)
            self.lease.expect(tab.name, lambda: any(one.name == tab.name for one in self.tabs))

    def _all(self, tab: Tab) -> bytes:
        return encoded_message("snapshot", self.snapshot(tab.name), self._past.number).text

    def _lease_of(self, tab: Tab) -> Message:
        return encoded_message("lease", self.lease.seen_by(tab.name))

    async def _reconnect(self, tab: Tab) -> None:
        """Connect to a mission that was started outside the app, if there is one."""
        if live_path(self.path).exists():
            await self.ready()
            if self.under_way:
                tab.send_snapshot()


def _public_state(one: dict[str, Any], zero: float) -> dict[str, Any]:
    """The public part of a state, with times in seconds since the mission began (`zero`)."""
    hidden = ("begins", "last", "sampled", "order")
    return {
        **{key: value for key, value in one.items() if key not in hidden},
        "track": [[point[0] - zero, *point[1:]] for point in one["track"]],
        "samples": [[each[0] - zero, *each[1:]] for each in one["samples"]],
    }


def _event_since(event: dict[str, Any], zero: float) -> dict[str, Any]:
    return {**{k: v for k, v in event.items() if k != "at"}, "t": event["at"] - zero}


class Fleet:
    """The watches of all surveys, and the lease that says who steers."""

    def __init__(self, surveys: library.Library) -> None:
        self.surveys = surveys
        self.lease = Lease()
        self._watches: dict[str, MissionWatch] = {}

    def watch(self, survey_id: str) -> MissionWatch:
        """The watch of a survey."""
        path = self.surveys.path(survey_id)
        watch = self._watches.get(survey_id)
        if watch is None:
            watch = self._watches[survey_id] = MissionWatch(survey_id, path, self.lease)
        return watch

    def forget(self, survey_id: str) -> None:
        """Drop the watch of a deleted survey."""
        self._watches.pop(survey_id, None)

    def state(self, survey_id: str) -> str | None:
        """The state of a mission under way; None if there is none, or if it is not watched."""
        watch = self._watches.get(survey_id)
        if watch is None or not watch.under_way or not watch.state:
            return None
        return str(watch.state["status"]["state"])

    def send_lease(self) -> None:
        """Tell all tabs who steers."""
        for watch in self._watches.values():
            for tab in watch.tabs:
                tab.send(LEASE)
