"""From an estimate to thrusts: those of a new step, of the last plan, or of the guard.

The helm of the survey, or that of the route home, plans at each control step, and the boat follows
the plan between two steps. The boat receives only thrusts that the guard permits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from grebe.control.controller import Command
from grebe.control.separation import AnnouncedPath
from grebe.control.tracker import Tracker
from grebe.core.dynamics import Weather
from grebe.core.events import Prediction, Step, Thrusts
from grebe.core.inner_loop import held_motion
from grebe.core.survey import Target
from grebe.links.base import Observation, Order
from grebe.mission.events.publisher import Publisher
from grebe.mission.gate import Gate
from grebe.mission.helm import (
    AdaptableHelm,
    ForeseeingHelm,
    Helm,
    TrafficAwareHelm,
    possible_thrusts,
    step_of,
)
from grebe.mission.safety.fence import Schedule
from grebe.mission.safety.guard import Guard
from grebe.mission.safety.lookout import Lookout
from grebe.mission.safety.states import Place, SafetyState


class Steering:
    """Steers one boat with `controller` through `targets`; `stopwatch` times the steps [s];
    `lookout` is needed in a fleet only.

    `thrusts` are the thrusts last intended for the boat, and `ordered` are those commanded to
    obtain them [N]. They differ if the thrusters are weak or lag.
    """

    def __init__(
        self,
        controller: Helm,
        targets: Sequence[Target],
        gate: Gate,
        tracker: Tracker,
        guard: Guard,
        publisher: Publisher,
        stopwatch: Callable[[], float],
        lookout: Lookout | None = None,
    ) -> None:
        self.controller, self._targets = controller, targets
        self._gate, self._tracker, self._guard = gate, tracker, guard
        self._publisher, self._stopwatch = publisher, stopwatch
        self._lookout = lookout
        self._next_step_s = 0.0
        self._command: tuple[float, Command] | None = None
        self.thrusts: Thrusts = (0.0, 0.0)
        self.ordered: Thrusts = (0.0, 0.0)

    def take_order(self, controller: Helm, targets: Sequence[Target], time_s: float) -> None:
        """Steer through other targets from now on, with the boat's estimated parameters."""
        self.controller, self._targets = controller, targets
        if isinstance(controller, AdaptableHelm) and controller.vessel != self._tracker.vessel:
            controller.take_for(self._tracker.vessel)
        self._command = None
        self.restart(time_s)

    def restart(self, time_s: float) -> None:
        """Make a new control step at the next estimate."""
        self._next_step_s = time_s

    def adopt_model(self) -> None:
        """Plan with the boat's estimated parameters from now on."""
        for one in (self.controller, self._guard.helm, self._guard):
            if isinstance(one, AdaptableHelm):
                one.take_for(self._tracker.vessel)

    def act(
        self, observation: Observation, reached: int, *, idle: bool, waits_at: Place | None = None
    ) -> None:
        """Give the boat its thrusts: those of the guard, of a new step, or of the last plan.

        If the survey's helm steers, an `idle` boat gets none, and a boat with a place `waits_at`
        gets the thrusts that keep it there.
        """
        own = self._guard.own_thrusts(observation, self._weather)
        if own is not None:
            if own != self.thrusts:
                self.send(observation, own)
                self._publish_step(observation, None)
        elif idle and self._helm is self.controller:
            self.send(observation, (0.0, 0.0))
        elif waits_at is not None and self._helm is self.controller:
            self.send(observation, self._guard.waits_at(observation, self._weather, waits_at))
            self._publish_step(observation, None)
        elif observation.time_s >= self._next_step_s - 1e-9:
            self._steer(observation, reached)
        else:
            self._follow_plan(observation, reached)
        if self._lookout is not None:
            self._lookout.announce(self._announced(observation, waits=idle or waits_at is not None))

    def _announced(self, observation: Observation, *, waits: bool) -> AnnouncedPath:
        """Return where the boat is going to be, for the plans of other boats."""
        helm, command = self._guard.helm or (None if waits else self.controller), self._command
        keeps = self._guard.own_thrusts(observation, self._weather) is not None
        if keeps or helm is None or command is None or command[1].plan is None:
            return AnnouncedPath.at_rest((observation.state[0], observation.state[1]))
        return AnnouncedPath.of_plan(command[1].plan, observation.time_s - command[0])

    def ahead(self, observation: Observation) -> Schedule | None:
        """Return the planned thrusts over time; None without a plan."""
        if self._command is None:
            return None
        since, command = self._command
        return lambda seconds: command.thrusts_at(observation.time_s - since + seconds)

    def send(self, observation: Observation, thrusts: Thrusts) -> None:
        """Command thrusts, and the motion to which they lead for a boat driven by its motion."""
        vessel = self.controller.vessel
        surge, yaw_rate = held_motion(vessel, observation.state, thrusts, self._weather)
        ordered = self._tracker.orders_for(observation.time_s, thrusts)
        self._gate.command(Order(thrusts=ordered, surge_mps=surge, yaw_rate_radps=yaw_rate))
        self._tracker.sent(observation.time_s, ordered)
        self.thrusts, self.ordered = thrusts, ordered

    @property
    def _helm(self) -> Helm:
        """The helm that steers now: the survey's, or that of the route home."""
        return self._guard.helm or self.controller

    @property
    def _weather(self) -> Weather:
        return self._tracker.weather

    def _steer(self, observation: Observation, reached: int) -> None:
        began = self._stopwatch()
        helm = self._helm
        elapsed = None if self._command is None else observation.time_s - self._command[0]
        then_s = observation.time_s - observation.age_s
        state = self._tracker.ahead(then_s, observation.time_s, observation.state)
        if isinstance(helm, ForeseeingHelm):
            helm.expect(self._tracker.thrusters(observation.time_s))
        if self._lookout is not None and isinstance(helm, TrafficAwareHelm):
            others = self._lookout.announced((state[0], state[1]))
            helm.heed(others, self._lookout.traffic.wide_m)
        command = helm.step(state, self._weather, elapsed)
        solve_ms = 1e3 * (self._stopwatch() - began)
        self._command = (observation.time_s, command)
        self._apply(observation, reached, self._possible(command.thrusts_at(0.0)), solve_ms)
        if command.plan is not None:
            self._publisher.publish(
                Prediction,
                observation.time_s,
                after_s=np.concatenate([[0.0], np.cumsum(command.plan.durations)]),
                states=command.plan.states,
                thrusts=command.plan.thrusts,
            )
        self._next_step_s = observation.time_s + step_of(helm)

    def _follow_plan(self, observation: Observation, reached: int) -> None:
        """Between two control steps, change the thrusts when the plan does."""
        if self._command is None:
            return
        since, command = self._command
        thrusts = self._possible(command.thrusts_at(observation.time_s - since))
        if thrusts != self.thrusts or self._tracker.compensates_lag:
            self._apply(observation, reached, thrusts, None)

    def _possible(self, thrusts: Sequence[float]) -> Thrusts:
        return possible_thrusts(self.controller.vessel, thrusts)

    def _apply(
        self, observation: Observation, reached: int, thrusts: Thrusts, solve_ms: float | None
    ) -> None:
        """Send the thrusts, or the guard's if it does not permit them, and report the step."""
        ahead = self.ahead(observation) or (lambda _: thrusts)
        if not self._guard.permitted(observation, ahead, self._weather, reached):
            self.restart(observation.time_s)
            thrusts = self._guard.own_thrusts(observation, self._weather) or (0.0, 0.0)
        self.send(observation, thrusts)
        self._publish_step(observation, solve_ms)

    def _publish_step(self, observation: Observation, solve_ms: float | None) -> None:
        """Report the thrusts sent to the boat, by a helm's command or by the guard."""
        surveys = self._guard.state is SafetyState.SURVEYING
        command = None if self._command is None else self._command[1]
        steered = command is not None and (surveys or self._guard.helm is not None)
        self._publisher.publish(
            Step,
            observation.time_s,
            state=observation.state,
            thrusts=self.thrusts,
            target_seq=self._targets[command.target].seq if command and surveys else None,
            split_stage=command.split if command and steered else None,
            solve_ms=solve_ms,
            status=command.status.value if command and steered else self._guard.state.value,
            solved=not (command and steered) or command.status.is_solved or solve_ms is None,
            current_north_mps=self._weather.current_north_mps,
            current_east_mps=self._weather.current_east_mps,
        )
