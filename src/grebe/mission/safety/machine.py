"""The state machine: what the boat may do from an estimate on, given its memory and the facts.

`next_memory` is a pure function. It checks first for causes to stop, then for causes to get free,
and then for causes to go home; a request comes before the boat's own judgement of time and battery.
Each cause has a row in docs/safety.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

from grebe.control.station import reach_mps
from grebe.core.vessel import Vessel
from grebe.links.base import Observation
from grebe.mission.safety.memory import (
    WAITS,
    Asked,
    Memory,
    Request,
    changed,
    going_on_with,
    put_on_hold,
    sent_home,
    stopped,
)
from grebe.mission.safety.reserve import must_go_home, updated_battery
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, Facts, Finding, Place, SafetyState
from grebe.mission.safety.stuck import Motion, held_fast, updated_motion
from grebe.mission.safety.thrusters import dead_thruster, updated_turning
from grebe.mission.safety.waiting import Stuck

# A boat that was braked at the fence resumes after `BRAKED_S` [s] if it is slower than `SLOW_MPS`
# and within `BACK_M` [m] of its refuge; otherwise after `LONGEST_S` [s], because wind may keep it
# away from the refuge.
BRAKED_S, SLOW_MPS, BACK_M, LONGEST_S = 1.0, 0.4, 1.6, 20.0
# A boat that is outside its fence for this long cannot keep inside it [s].
OUTSIDE_S = 60.0
# A boat goes home if current and wind leave it less than this share of its speed for this long [s]:
# they may become stronger still.
STRONG_CURRENT_SHARE, STRONG_CURRENT_S = 0.35, 5.0
# A boat that is at most this far behind the distance that its thrust should give moves freely [m].
UNHELD_M = 1.0
# The least speed over the current that counts as headway [m/s].
LEAST_REACH_MPS = 0.05


def next_memory(
    memory: Memory,
    facts: Facts,
    settings: SafetySettings,
    vessel: Vessel,
    asked: tuple[Asked, ...] = (),
) -> Memory:
    """Return the memory from this estimate on: what the boat does, and why.

    If the boat has to be stopped or freed at this estimate, the requests `asked` are answered
    later.
    """
    asked = (*memory.asked, *asked)
    seen = _updated(memory, facts, settings, vessel, asked)
    for judge in (_causes_to_stop, _causes_to_free):
        found = judge(seen, facts, settings)
        if found is not None:
            return found
    if asked:
        seen = replace(seen, asked=())
        for one in asked:
            seen = _answered(seen, facts, one)
        return seen
    return _by_own_judgement(seen, facts, settings)


def _by_own_judgement(memory: Memory, facts: Facts, settings: SafetySettings) -> Memory:
    """Return the memory of a boat that acts by its own judgement, without a request."""
    if memory.state is SafetyState.SURVEYING or _waits_in_the_survey(memory):
        finding = must_go_home(memory.battery, facts, settings) or _strong_current(memory, facts)
        if finding is not None:
            return sent_home(memory, facts, finding)
    if memory.state is SafetyState.SURVEYING:
        return _unmeasured(memory, facts, settings)
    if memory.state is SafetyState.HOLDING:
        return _held(memory, facts)
    if memory.state is SafetyState.RETURNING and facts.at_home:
        text = f"the boat is home; it returned because: {memory.homeward}"
        return stopped(memory, facts, Finding(cause=Cause.HOME, message=text))
    return memory


def at_the_fence(memory: Memory, facts: Facts, settings: SafetySettings, refuge: Place) -> Memory:
    """Return the memory of a boat that could no longer stop inside the fence if it went on: it
    brakes and goes back to a refuge. After a few times it goes home, or its mission ends.
    """
    if memory.state in (SafetyState.HOLDING, SafetyState.STOPPED):
        return memory
    going, tried = going_on_with(memory), memory.fenced + 1
    if tried > settings.fence_tries:
        text = f"braked at the fence {memory.fenced} times on the way to the same place"
        finding = Finding(cause=Cause.FENCE, message=text)
        if going is SafetyState.RETURNING:
            return stopped(memory, facts, finding)
        memory, going = replace(memory, homeward=text), SafetyState.RETURNING
        tried = 0
    text = "the boat could no longer stop inside the fence if it went on"
    finding = Finding(cause=Cause.FENCE, message=text)
    return replace(put_on_hold(memory, facts, finding, refuge, going), fenced=tried)


def in_traffic(memory: Memory, facts: Facts, refuge: Place) -> Memory:
    """Return the memory of a boat that would come too near to another: it stops, and waits at a
    `refuge` where it is in nobody's way.
    """
    if memory.state in (SafetyState.HOLDING, SafetyState.STOPPED):
        return memory
    text = "the boat would come too close to another boat"
    finding = Finding(cause=Cause.TRAFFIC, message=text)
    return put_on_hold(memory, facts, finding, refuge, going_on_with(memory))


def after_waiting(memory: Memory, facts: Facts, stuck: Stuck) -> Memory | None:
    """Return the memory of a boat that waits for others, by how `stuck` it is; None to wait on."""
    match stuck:
        case Stuck.WAITS:
            return None
        case Stuck.GOES_FIRST:
            text = "the boats that it would let go first are waiting for it: it goes first"
            return going_on(memory, facts, text)
        case Stuck.GOES_HOME:
            text = "other boats block its path: it gives way and goes home"
            return sent_home(memory, facts, Finding(cause=Cause.TRAFFIC, message=text))
        case Stuck.GIVES_UP:
            waited_s = facts.time_s - memory.since_s
            text = f"other boats have blocked its path for {waited_s / 60:.0f} minutes"
            return stopped(memory, facts, Finding(cause=Cause.TRAFFIC, message=text))


def going_on(memory: Memory, facts: Facts, why: str = "the path is clear of other boats") -> Memory:
    """Return the memory of a boat that waited for others, once its path is clear."""
    finding = Finding(cause=Cause.CLEAR, message=why)
    return changed(memory, facts, memory.resumes, finding)


def without_estimates(
    memory: Memory, time_s: float, seconds: float, settings: SafetySettings
) -> Memory:
    """Return the memory of a boat after `seconds` without a usable estimate: it stops, as far as
    dead reckoning allows. After `settings.blind_s` its mission ends.
    """
    if memory.state is SafetyState.STOPPED:
        return memory
    if seconds > settings.blind_s:
        text = f"no usable estimate for {seconds:.0f} s"
        return replace(
            memory, state=SafetyState.STOPPED, cause=Cause.BLIND, message=text, since_s=time_s
        )
    if memory.cause is Cause.BLIND:
        return memory
    passing = memory.state in (SafetyState.HOLDING, SafetyState.FREEING)
    # A boat that was asked to hold its position does so again once it gets estimates.
    held = memory.cause is Cause.HOLD
    again = (Asked(request=Request.HOLD, why=memory.message),) if held else ()
    return replace(
        memory,
        asked=(*again, *memory.asked),
        state=SafetyState.HOLDING,
        cause=Cause.BLIND,
        message="no usable estimate: the boat is braked and left without thrust",
        since_s=time_s,
        resumes=memory.resumes if passing else memory.state,
    )


def without_route_home(memory: Memory, time_s: float, why: str) -> Memory:
    """Return the memory of a boat that was sent home but has no route there: its mission ends."""
    return replace(
        memory,
        state=SafetyState.STOPPED,
        cause=Cause.NO_WAY_HOME,
        message=f"{memory.homeward}, but: {why}",
        since_s=time_s,
    )


def shut_in(memory: Memory, observation: Observation, why: str) -> Memory:
    """Return the memory of a boat that is sent home but shut in by a closed area: it holds its
    position until somebody opens the area or fetches the boat.
    """
    return replace(
        memory,
        state=SafetyState.HOLDING,
        cause=Cause.HOLD,
        message=f"{memory.homeward}, but: {why}",
        since_s=observation.time_s,
        resumes=SafetyState.SURVEYING,
        place=(observation.state[0], observation.state[1]),
    )


def _updated(
    memory: Memory,
    facts: Facts,
    settings: SafetySettings,
    vessel: Vessel,
    asked: tuple[Asked, ...],
) -> Memory:
    """Return the memory, updated with this estimate and its requests."""
    drives = memory.state in (SafetyState.SURVEYING, SafetyState.RETURNING)
    motion = updated_motion(memory.motion, facts, vessel, settings.least_depth_m)
    if memory.reached != facts.reached:
        memory = replace(memory, fenced=0, astern=0, reached=facts.reached)
    left = reach_mps(vessel, facts.weather)
    strong = left < LEAST_REACH_MPS
    is_strong = left < STRONG_CURRENT_SHARE * vessel.speed_max_mps
    strong_since = memory.strong_since_s if memory.strong_since_s is not None else facts.time_s
    astray = memory.cause is Cause.FENCE and facts.outside
    since = memory.against_s if memory.against_s is not None else facts.time_s
    return replace(
        memory,
        asked=asked,
        motion=motion if drives else Motion(),
        turning=updated_turning(memory.turning, facts, vessel),
        battery=updated_battery(memory.battery, facts),
        against_s=since if strong or astray else None,
        carried=strong,
        ignores_silence=memory.ignores_silence and bool(facts.mute),
        strong_since_s=strong_since if is_strong else None,
    )


def _causes_to_stop(memory: Memory, facts: Facts, settings: SafetySettings) -> Memory | None:
    """Return the memory of a boat whose mission has to end at once, or that a current carries off;
    None if there is no such cause.
    """
    dead = dead_thruster(memory.turning)
    if dead is not None:
        return stopped(memory, facts, dead)
    carried = _carried_off(memory, facts, settings)
    if carried is not None:
        return carried
    if memory.state is SafetyState.RETURNING and facts.home_given_up:
        text = f"home was not reached: {memory.homeward}"
        return stopped(memory, facts, Finding(cause=Cause.NO_WAY_HOME, message=text))
    return None


def _carried_off(memory: Memory, facts: Facts, settings: SafetySettings) -> Memory | None:
    """Return the memory of a boat that has been carried off, or outside its fence, for too long;
    None if it has not.
    """
    seconds = 0.0 if memory.against_s is None else facts.time_s - memory.against_s
    if seconds <= (settings.against_s if memory.carried else OUTSIDE_S):
        return None
    if not memory.carried:
        text = f"the boat has been outside its fence for {seconds:.0f} s"
        return stopped(memory, facts, Finding(cause=Cause.FENCE, message=text))
    speed = math.hypot(facts.weather.current_north_mps, facts.weather.current_east_mps)
    text = f"a current of {speed:.1f} m/s, with the wind, is stronger than the boat"
    finding = Finding(cause=Cause.CURRENT, message=text)
    carries_home = facts.home_s is not None and math.isfinite(facts.home_s)
    if memory.state is SafetyState.RETURNING and carries_home:
        return None
    if memory.state is SafetyState.SURVEYING and carries_home:
        return sent_home(memory, facts, finding)
    return stopped(memory, facts, finding)


def _strong_current(memory: Memory, facts: Facts) -> Finding | None:
    """Return the finding of a current that is weaker than the boat, but too strong to stay out."""
    knows_home = facts.home_s is not None and math.isfinite(facts.home_s)
    # To the observer, a boat held by weeds looks like a boat in a current.
    held = memory.motion.behind_m > UNHELD_M
    if memory.strong_since_s is None or held or not knows_home:
        return None
    if facts.time_s - memory.strong_since_s < STRONG_CURRENT_S:
        return None
    text = "the current and the wind leave the boat too little speed"
    return Finding(cause=Cause.CURRENT, message=text)


def _causes_to_free(memory: Memory, facts: Facts, settings: SafetySettings) -> Memory | None:
    """Return the memory of a boat that begins or ends an attempt to get free by going astern, or
    gives up after too many; None in all other cases.
    """
    if memory.state is SafetyState.FREEING:
        if facts.time_s - memory.since_s < settings.astern_s:
            return None
        text = f"went astern for {settings.astern_s:g} s, try {memory.astern} of {settings.tries}"
        return changed(memory, facts, memory.resumes, Finding(cause=Cause.FREE, message=text))
    held = held_fast(memory.motion, settings)
    # A boat that may have lost a thruster does not get free by going astern with the other.
    if held is None or memory.turning.side:
        return None
    if memory.astern >= settings.tries:
        text = f"{held.message}, and going astern {memory.astern} times has not freed the boat"
        return stopped(memory, facts, Finding(cause=held.cause, message=text))
    freeing = changed(memory, facts, SafetyState.FREEING, held)
    return replace(freeing, resumes=memory.state, astern=memory.astern + 1)


def _answered(memory: Memory, facts: Facts, asked: Asked) -> Memory:
    """Return the memory of a boat after a request."""
    if asked.request is Request.HOME:
        if SafetyState.RETURNING in (memory.state, memory.resumes):
            return memory
        return sent_home(memory, facts, Finding(cause=Cause.COME_HOME, message=asked.why))
    if asked.request is Request.HOLD:
        if memory.state is SafetyState.HOLDING:
            return replace(memory, cause=Cause.HOLD, message=asked.why)
        finding = Finding(cause=Cause.HOLD, message=asked.why)
        return put_on_hold(memory, facts, finding, facts.place, going_on_with(memory))
    if memory.state is not SafetyState.HOLDING or memory.cause not in WAITS:
        return memory
    finding = Finding(cause=Cause.GO_ON, message=asked.why)
    going = changed(memory, facts, memory.resumes, finding)
    return replace(going, ignores_silence=memory.cause is Cause.UNMEASURED)


def _waits_in_the_survey(memory: Memory) -> bool:
    """Whether the boat holds its position during the survey, for an unlimited time."""
    waits = memory.state is SafetyState.HOLDING and memory.cause in WAITS
    return waits and memory.resumes is SafetyState.SURVEYING


def _unmeasured(memory: Memory, facts: Facts, settings: SafetySettings) -> Memory:
    """Return the memory of a surveying boat: it holds its position while an instrument is silent
    for too long, unless it has been asked to go on.
    """
    if memory.ignores_silence or facts.mute_s <= settings.mute_s:
        return memory
    text = f"{facts.mute} has sent nothing for {facts.mute_s:.0f} s: the survey waits for it"
    finding = Finding(cause=Cause.UNMEASURED, message=text)
    return put_on_hold(memory, facts, finding, facts.place, SafetyState.SURVEYING)


def _held(memory: Memory, facts: Facts) -> Memory:
    """Return the memory of a boat that holds its position: it goes on as soon as it may."""
    if memory.cause is Cause.UNMEASURED and not facts.mute:
        finding = Finding(cause=Cause.MEASURES, message="every instrument sends readings again")
        return changed(memory, facts, memory.resumes, finding)
    if memory.cause is Cause.BLIND:
        finding = Finding(cause=Cause.SEES, message="estimates are arriving again")
        return changed(memory, facts, memory.resumes, finding)
    if memory.cause is not Cause.FENCE or facts.outside:
        return memory
    held_s = facts.time_s - memory.since_s
    away = math.hypot(facts.place[0] - memory.place[0], facts.place[1] - memory.place[1])
    slow = math.hypot(facts.state[3], facts.state[4]) < SLOW_MPS
    if held_s < BRAKED_S or not ((slow and away < BACK_M) or held_s > LONGEST_S):
        return memory
    finding = Finding(cause=Cause.INSIDE_AGAIN, message="the boat is inside the fence again")
    return changed(memory, facts, memory.resumes, finding)
