"""The memory of the state machine, and its transitions from one state to another."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace

from grebe.core.events import EndReason
from grebe.mission.safety.reserve import Battery
from grebe.mission.safety.states import ENDS, Cause, Facts, Finding, Place, SafetyState
from grebe.mission.safety.stuck import Motion
from grebe.mission.safety.thrusters import Turning

# The causes for which a boat holds its position without a time limit.
WAITS = (Cause.HOLD, Cause.UNMEASURED)


class Request(enum.Enum):
    """What may be requested of a mission, besides its end."""

    HOME = "home"
    HOLD = "hold"
    GO_ON = "go on"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A request and its reason."""

    request: Request
    why: str


@dataclass(frozen=True, kw_only=True)
class Memory:
    """What the state machine remembers between estimates.

    The boat has been in `state` since `since_s` for `cause`, and `message` says why. `resumes` is
    the state to which a temporary state returns, and `place` the position that is held. `homeward`
    says why the boat was sent home. `fenced` and `astern` count the attempts since `reached`
    targets were reached. `against_s` is the time since which the boat has been carried off
    (`carried`: by a current or wind stronger than it) or outside its fence. `strong_since_s` is the
    time since which it has been little faster than its drift. `ignores_silence`: somebody has told
    the boat to go on without the silent instrument. `asked` are the requests not yet answered.
    """

    state: SafetyState = SafetyState.SURVEYING
    cause: Cause | None = None
    message: str = ""
    since_s: float = 0.0
    resumes: SafetyState = SafetyState.SURVEYING
    homeward: str = ""
    place: Place = (0.0, 0.0)
    fenced: int = 0
    astern: int = 0
    reached: int = 0
    against_s: float | None = None
    carried: bool = False
    strong_since_s: float | None = None
    ignores_silence: bool = False
    asked: tuple[Asked, ...] = ()
    motion: Motion = field(default_factory=Motion)
    turning: Turning = field(default_factory=Turning)
    battery: Battery = field(default_factory=Battery)

    @property
    def end(self) -> EndReason | None:
        """The reason for which the mission ends; None while it continues."""
        stopped = self.state is SafetyState.STOPPED and self.cause is not None
        return ENDS[self.cause] if stopped and self.cause is not None else None


def sent_home(memory: Memory, facts: Facts, finding: Finding) -> Memory:
    """Return the memory of a boat that goes home because of a finding."""
    sent = changed(memory, facts, SafetyState.RETURNING, finding)
    return replace(sent, homeward=finding.message, resumes=SafetyState.RETURNING)


def going_on_with(memory: Memory) -> SafetyState:
    """Return the present state, or, for a boat that goes astern, the state before that."""
    return memory.resumes if memory.state is SafetyState.FREEING else memory.state


def put_on_hold(
    memory: Memory, facts: Facts, finding: Finding, place: Place, going: SafetyState
) -> Memory:
    """Return the memory of a boat that holds a place, and afterwards resumes `going`."""
    held = changed(memory, facts, SafetyState.HOLDING, finding)
    return replace(held, resumes=going, place=place)


def stopped(memory: Memory, facts: Facts, finding: Finding) -> Memory:
    """Return the memory of a boat that is stopped because its mission is over."""
    return changed(memory, facts, SafetyState.STOPPED, finding)


def changed(memory: Memory, facts: Facts, state: SafetyState, finding: Finding) -> Memory:
    """Return the memory of a boat in a new state; its motion in the old state is forgotten."""
    return replace(
        memory,
        state=state,
        cause=finding.cause,
        message=finding.message,
        since_s=facts.time_s,
        motion=Motion(),
        against_s=None,
    )
