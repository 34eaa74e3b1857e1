"""What the state machine remembers, and how it goes from one state to another."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace

from grebe.core.events import EndReason
from grebe.mission.safety.reserve import Battery
from grebe.mission.safety.states import ENDS, Cause, Facts, Finding, Place, SafetyState
from grebe.mission.safety.stuck import Motion
from grebe.mission.safety.thrusters import Turning

# What a boat holds its place for until somebody, or something, lets it go on.
WAITS = (Cause.HOLD, Cause.UNMEASURED)


class Request(enum.Enum):
    """What somebody may ask of a mission, beside the end."""

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
    """What the machine knows from before.

    `state` since `since_s` for `cause`, and `message` says why; `resumes` is the state that a
    passing one goes back to; `place` the one that is held. `fenced` and `astern` count what was
    tried since `reached` targets. `against_s`: since when the boat is carried off
    (`carried`: by a current or a wind that is stronger than it) or outside its fence;
    `tired_s`: since when it is little faster than what carries it. `unheeded`: somebody has told
    the boat to go on without the instrument that is silent. `asked` is what somebody has asked and
    nobody has answered yet.
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
    tired_s: float | None = None
    unheeded: bool = False
    asked: tuple[Asked, ...] = ()
    motion: Motion = field(default_factory=Motion)
    turning: Turning = field(default_factory=Turning)
    battery: Battery = field(default_factory=Battery)

    @property
    def end(self) -> EndReason | None:
        """What the mission ends with; None while it goes on."""
        stopped = self.state is SafetyState.STOPPED and self.cause is not None
        return ENDS[self.cause] if stopped and self.cause is not None else None


def sent_home(memory: Memory, facts: Facts, finding: Finding) -> Memory:
    """The boat goes home for what was found."""
    sent = changed(memory, facts, SafetyState.RETURNING, finding)
    return replace(sent, homeward=finding.message, resumes=SafetyState.RETURNING)


def going_on_with(memory: Memory) -> SafetyState:
    """What a boat was about before it got out of something astern, or is about now."""
    return memory.resumes if memory.state is SafetyState.FREEING else memory.state


def put_on_hold(
    memory: Memory, facts: Facts, finding: Finding, place: Place, going: SafetyState
) -> Memory:
    """The boat holds a place, and goes back to what it was about."""
    held = changed(memory, facts, SafetyState.HOLDING, finding)
    return replace(held, resumes=going, place=place)


def stopped(memory: Memory, facts: Facts, finding: Finding) -> Memory:
    """The boat is stopped, and the mission over."""
    return changed(memory, facts, SafetyState.STOPPED, finding)


def changed(memory: Memory, facts: Facts, state: SafetyState, finding: Finding) -> Memory:
    """The boat is in a state from now on; how it moved in the one before is forgotten."""
    return replace(
        memory,
        state=state,
        cause=finding.cause,
        message=finding.message,
        since_s=facts.time_s,
        motion=Motion(),
        against_s=None,
    )
