"""The start of a mission: on the water, or ashore until other boats have left the harbour."""

from __future__ import annotations

from collections.abc import Callable

from grebe.core.events import EndReason, Warned
from grebe.links.base import Observation
from grebe.mission.estimates import EstimateReader
from grebe.mission.events.publisher import Publisher
from grebe.mission.gate import OverError
from grebe.mission.safety.lookout import Lookout


def launched(
    estimates: EstimateReader,
    publisher: Publisher,
    lookout: Lookout | None,
    asked_to_stop: Callable[[], str],
) -> Observation:
    """Return the first estimate on the water; `asked_to_stop` says who wants the mission to end.

    Raises `OverError` if the boat is stopped or called home while it is ashore, or if it can no
    longer set out.
    """
    observation, said = estimates.next(), False
    while lookout and not lookout.launches((observation.state[0], observation.state[1])):
        if request := asked_to_stop():
            raise OverError(EndReason.STOPPED, request)
        if lookout.is_called:
            raise OverError(EndReason.CAME_HOME, "the boat was called home before it set out")
        if lookout.is_alone:
            text = (
                "another boat blocks its harbour and will not move: no other boat is still sailing"
            )
            raise OverError(EndReason.TARGET_GIVEN_UP, text)
        if not said:
            text = (
                "another boat is near its harbour: the boat waits ashore until that has left, "
                "then sets out by itself"
            )
            publisher.publish(Warned, observation.time_s, code="waits_ashore", message=text)
            publisher.release()
            said = True
        observation = estimates.next()
    return observation
