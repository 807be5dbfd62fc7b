"""Injection of faults by name, such as "camera freezes at 3 s", into any robot."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from skills.faults.fault_kinds import VERBS, Call
from skills.faults.fault_words import Fault, parse_fault
from skills.robot import Clock, Robot


@dataclass
class _Armed:
    """A fault in use: its memory and the number of calls so far."""

    fault: Fault
    memory: dict[Any, Any] = field(default_factory=dict)
    seen: int = 0

    def through(self, call: Call, now_s: float) -> Any:
        """Makes the call, changed by the fault while it is on."""
        effect = self.fault.effect
        if call.verb in effect.always:
            return effect.act(call)
        self.seen += 1
        if self.on(now_s) and self.seen > self.fault.calls:
            return effect.act(call)
        result = call.proceed()
        effect.watch(result, call)
        return result

    def on(self, now_s: float) -> bool:
        """Returns whether the fault is on at a time."""
        return self.fault.from_s - 1e-9 <= now_s < self.fault.to_s - 1e-9

    def concerns(self, verb: str, arguments: tuple[Any, ...]) -> bool:
        """Returns whether the fault concerns a call."""
        if verb == "image" and self.fault.source not in (None, *arguments[:1]):
            return False
        return verb in self.fault.effect.verbs | self.fault.effect.always


class FaultyRobot:
    """Robot whose verbs fail by its faults, with times that count from `since_s`. `inject_faults` makes one."""

    def __init__(self, robot: Robot, clock: Clock, faults: Sequence[Fault], since_s: float) -> None:
        self._robot, self._clock, self._since_s = robot, clock, since_s
        self._armed = [_Armed(fault) for fault in faults]

    def faults_at_work(self) -> tuple[str, ...]:
        """The words of the faults that are on now; a fault "after N calls" is on from the call after these."""
        now_s = self._clock.now() - self._since_s
        return tuple(each.fault.words for each in self._armed if each.on(now_s) and each.seen >= each.fault.calls)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._robot, name)
        if name not in VERBS:
            return value

        bind = inspect.signature(value).bind

        def faulty(*arguments: Any, **options: Any) -> Any:
            """Calls the verb through the faults."""
            bound = bind(*arguments, **options)
            bound.apply_defaults()
            return self._call(name, lambda: value(*arguments, **options), tuple(bound.arguments.values()))

        self.__dict__[name] = faulty
        return faulty

    def _call(self, verb: str, proceed: Callable[[], Any], arguments: tuple[Any, ...]) -> Any:
        """Makes a call through all faults that concern the verb, the first one outermost."""
        now_s = self._clock.now() - self._since_s
        for armed in reversed(self._armed):
            if armed.concerns(verb, arguments):
                call = Call(self._robot, verb, proceed, arguments, armed.memory)
                proceed = partial(armed.through, call, now_s)
        return proceed()


def inject_faults(robot: Robot, clock: Clock, faults: Sequence[Fault | str], *, since_s: float | None = None) -> Robot:
    """Returns the robot with these faults, given as words or parsed; their times count from now, or from `since_s`.

    Raises ValueError for words that are no fault of this robot.
    """
    named = any(isinstance(fault, str) for fault in faults)
    cameras = [camera.source for camera in robot.capabilities().cameras] if named else []
    parsed = [parse_fault(fault, cameras=cameras) if isinstance(fault, str) else fault for fault in faults]
    begun_s = clock.now() if since_s is None else since_s
    return cast(Robot, FaultyRobot(robot, clock, parsed, begun_s)) if parsed else robot
