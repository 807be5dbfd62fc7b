"""Injection of faults by name: "camera freezes at 3 s", around any robot.

A fault is the words of its kind and, perhaps, when it is on: `at T s` or `from T s` (and ever after),
`from T s to U s`, `after N calls` (of the verbs concerned), or nothing (always). Times count from
the moment the robot was wrapped.
"""

from __future__ import annotations

import difflib
import inspect
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from skills.robot import Clock, Robot
from skills.testing.fault_kinds import STANDARD_FAULTS, VERBS, Call, Effect, FaultKind

_WHEN = re.compile(
    r"(?P<what>.+?)"
    r"(?: (?:(?:at|from) (?P<from>\d+(?:\.\d+)?) ?s(?: (?:to|until) (?P<to>\d+(?:\.\d+)?) ?s)?"
    r"|after (?P<calls>\d+) calls?))?"
)


@dataclass(frozen=True)
class Fault:
    """A fault by its words: its effect, on from `from_s` until before `to_s`, after `calls` calls."""

    words: str
    effect: Effect
    from_s: float = 0.0
    to_s: float = math.inf
    calls: int = 0


def parse_fault(words: str, kinds: Sequence[FaultKind] = STANDARD_FAULTS) -> Fault:
    """The fault of these words.

    Raises ValueError: no kind has such words, or they name something that the robot does not have; with the hint.
    """
    when = _WHEN.fullmatch(" ".join(words.split()))
    what = words if when is None else when["what"]
    for kind in kinds:
        match = re.fullmatch(kind.pattern, what)
        if match is None or when is None:
            continue
        from_s, to_s = float(when["from"] or 0.0), float(when["to"] or math.inf)
        if to_s <= from_s:
            raise ValueError(f"'{words}' ends before it begins; write the earlier time first")
        return Fault(words, kind.effect(match), from_s, to_s, int(when["calls"] or 0))
    examples = [kind.example for kind in kinds]
    near = difflib.get_close_matches(words, examples, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"known are, for instance: {'; '.join(examples)}"
    raise ValueError(f"there is no fault '{words}'; {hint}")


@dataclass
class _Armed:
    """A fault at work: its memory and how many calls it has seen."""

    fault: Fault
    memory: dict[str, Any] = field(default_factory=dict)
    seen: int = 0

    def through(self, call: Call, now_s: float) -> Any:
        """The call as the fault lets it happen now."""
        effect = self.fault.effect
        if call.verb in effect.always:
            return effect.act(call)
        self.seen += 1
        if self.fault.from_s - 1e-9 <= now_s < self.fault.to_s and self.seen > self.fault.calls:
            return effect.act(call)
        result = call.proceed()
        effect.watch(result, call)
        return result


class FaultyRobot:
    """A robot whose verbs go wrong as its faults say. `with_faults` makes one."""

    def __init__(self, robot: Robot, clock: Clock, faults: Sequence[Fault]) -> None:
        self._robot, self._clock, self._begun_s = robot, clock, clock.now()
        self._armed = [_Armed(fault) for fault in faults]

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._robot, name)
        if name not in VERBS:
            return value

        bind = inspect.signature(value).bind

        def faulty(*arguments: Any, **options: Any) -> Any:
            """The verb as the faults let it happen."""
            given = tuple(bind(*arguments, **options).arguments.values())
            return self._call(name, lambda: value(*arguments, **options), given)

        self.__dict__[name] = faulty
        return faulty

    def _call(self, verb: str, proceed: Callable[[], Any], arguments: tuple[Any, ...]) -> Any:
        """The call through all faults that concern the verb, the first outermost."""
        now_s = self._clock.now() - self._begun_s
        for armed in reversed(self._armed):
            if verb in armed.fault.effect.verbs | armed.fault.effect.always:
                call = Call(self._robot, verb, proceed, arguments, armed.memory)
                proceed = partial(armed.through, call, now_s)
        return proceed()


def with_faults(robot: Robot, clock: Clock, faults: Sequence[Fault | str]) -> Robot:
    """The robot with these faults, given as words or parsed. Raises ValueError for words that are no fault."""
    parsed = [parse_fault(fault) if isinstance(fault, str) else fault for fault in faults]
    return cast(Robot, FaultyRobot(robot, clock, parsed)) if parsed else robot
