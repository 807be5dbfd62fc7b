"""Injection of faults by name, such as "camera freezes at 3 s", into any robot. `docs/reference/faults.md` lists them.

A fault is `SENSOR[.SOURCE]: WORDS`, or the words with the sensor or verb at their head, and perhaps a time: `at T s` or
`from T s` (and ever after), `from T s to U s`, `5 s at T s`, `after N calls` (of the verbs concerned), or no time
(always).
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np

from skills.faults.fault_kinds import STANDARD_FAULTS, SUBJECTS, Call, Effect, FaultKind
from skills.inputs.errors import nearest_name, suggestion
from skills.quantities import seconds_in
from skills.robot import Clock, Robot
from skills.robot_wrapper import AnswerT, RobotWrapper

_NUMBER: Final = r"\d+(?:\.\d+)?"
_WHEN: Final = re.compile(
    r"(?P<what>.+?)"
    rf"(?: (?:for )?(?P<lasts>{_NUMBER}) ?s)?"
    rf"(?: (?:(?:at|from) (?P<from>{_NUMBER}) ?s(?: (?:to|until) (?P<to>{_NUMBER}) ?s)?"
    r"|after (?P<calls>\d+) calls?))?"
)
_SPAN: Final = re.compile(
    rf"(?:PT[\dHMS.]+|\b{_NUMBER} ?(?:ms|min|mins|minutes?|h|hours?|days?|sec|secs|seconds?)\b"
    rf"(?: (?:and )?{_NUMBER} ?(?:min|mins|minutes?|s|sec|secs|seconds?)\b)*)"
)
_PREFIX: Final = re.compile(r"(?P<sensor>\w+)(?:\.(?P<source>[\w-]+))?: ?(?P<words>.+)")
_NUMBERS: Final = re.compile(r" -?\d.*")
_STREAM: Final = 11
"""Stream of the seed for random faults."""
_EARLIEST_S = 5.0
"""Earliest time of a random fault."""
_LATEST_S = 90.0
_MOTIONS: Final = ("arm", "base", "body")


@dataclass(frozen=True)
class Fault:
    """A fault parsed from its words: its effect, active from `from_s` until before `to_s`, after `calls` calls.

    With a `source`, it affects only the pictures of that camera.
    """

    words: str
    effect: Effect
    from_s: float = 0.0
    to_s: float = math.inf
    calls: int = 0
    source: str | None = None

    def over_by(self, now_s: float) -> bool:
        """Returns whether the fault is over at a time; a fault that happens once is over when it began earlier."""
        return now_s >= self.to_s or (self.effect.once and now_s > self.from_s)


def parse_fault(words: str, kinds: Sequence[FaultKind] = STANDARD_FAULTS, *, cameras: Sequence[str] = ()) -> Fault:
    """Parses the words of a fault. `cameras` are the robot's cameras, if the robot is known.

    Raises ValueError, with a hint, when no kind has such words or the robot has no such camera.
    """
    plain = _SPAN.sub(_seconds, " ".join(words.split()))
    prefix = _PREFIX.fullmatch(plain)
    source = None if prefix is None else prefix["source"]
    when = _WHEN.fullmatch(plain if prefix is None else f"{prefix['sensor']} {prefix['words']}")
    for kind in kinds if when is not None else ():
        assert when is not None
        match = re.fullmatch(kind.pattern, when["what"])
        if match is None:
            continue
        effect = kind.effect(match)
        if source is not None:
            _check_source(source, effect, cameras)
        return Fault(words, effect, *_span(words, when), int(when["calls"] or 0), source)
    said = plain if when is None else when["what"]
    known = _faults_of(nearest_name(said.partition(" ")[0], SUBJECTS), kinds)
    hint = f"known are, for instance: {'; '.join(known.values())}"
    if when is not None and (near := nearest_name(_NUMBERS.sub("", said), known)) is not None:
        middle = " " if prefix is None else plain[prefix.end("sensor") : prefix.start("words")]
        hint = f"did you mean '{known[near].replace(' ', middle, 1)}{when.string[when.end('what') :]}'?"
    raise ValueError(f"there is no fault '{words}'; {hint}")


def _faults_of(subject: str | None, kinds: Sequence[FaultKind]) -> Mapping[str, str]:
    """Returns the words of a subject's faults by the words without numbers; if there are none, all examples."""
    found = list[str]()
    for kind in kinds:
        said = _WHEN.sub(r"\g<what>", kind.example).partition(" ")[2]
        match = re.fullmatch(kind.pattern, f"{subject} {said}")
        with suppress(ValueError):  # the subject cannot have this fault
            found += [match[0]] if match is not None and kind.effect(match) else []
    return {_NUMBERS.sub("", each): each for each in found or [kind.example for kind in kinds]}


def _seconds(match: re.Match[str]) -> str:
    """Converts a duration of any unit to seconds; leaves other text unchanged."""
    seconds = seconds_in(match[0])
    return match[0] if seconds is None else f"{seconds:.12g} s"


def _span(words: str, when: re.Match[str]) -> tuple[float, float]:
    """Start and end of the fault (s). Raises ValueError when the words contradict each other."""
    from_s, to_s = float(when["from"] or 0.0), float(when["to"] or math.inf)
    if when["lasts"] is not None:
        if when["to"] is not None or when["calls"] is not None:
            raise ValueError(f"'{words}' gives the duration twice; write '5 s at 20 s' or 'from 20 s to 25 s'")
        to_s = from_s + float(when["lasts"])
    if to_s <= from_s:
        raise ValueError(f"'{words}' ends before it begins; write the earlier time first")
    return from_s, to_s


def _check_source(source: str, effect: Effect, cameras: Sequence[str]) -> None:
    """Raises ValueError unless the effect concerns pictures and the source is a camera of the robot."""
    if effect.verbs != {"image"}:
        raise ValueError(f"'.{source}' names a camera, but this fault does not concern cameras; remove '.{source}'")
    if cameras and source not in cameras:
        raise ValueError(f"the robot has no camera '{source}'; {suggestion(source, cameras)}")


def random_faults(
    count: int, seed: int, cameras: Sequence[str], kinds: Sequence[FaultKind] = STANDARD_FAULTS
) -> tuple[str, ...]:
    """Draws the words of `count` faults by a seed, from the kinds that allow it; sorted by time.

    A larger count adds faults to those of a smaller one.
    """
    rng = np.random.default_rng([seed, _STREAM])
    drawable = [kind.random for kind in kinds if kind.random]
    drawn = [_drawn(drawable[int(rng.integers(len(drawable)))], cameras, rng) for _ in range(count)]
    return tuple(words for _, words in sorted(drawn))


def _drawn(template: str, cameras: Sequence[str], rng: np.random.Generator) -> tuple[float, str]:
    """Draws one fault from a kind's template: its time (s) and its words."""
    images = [f"camera.{source}" for source in cameras] or ["camera"]
    at_s = round(float(rng.uniform(_EARLIEST_S, _LATEST_S)), 1)
    values = {
        "camera": images[int(rng.integers(len(images)))],
        "sensor": ("lidar", *images)[int(rng.integers(1 + len(images)))],
        "motion": _MOTIONS[int(rng.integers(len(_MOTIONS)))],
        "metres": round(float(rng.uniform(-0.3, 0.3)), 2),
        "span": f"{round(float(rng.uniform(1.0, 6.0)), 1):g} s at {at_s:g} s",
        "at": f"at {at_s:g} s",
    }
    return at_s, template.format(**values)


@dataclass
class _Armed:
    """An injected fault: its memory and the number of calls so far."""

    fault: Fault
    memory: dict[Any, Any] = field(default_factory=dict)
    seen: int = 0

    def through(self, call: Call, now_s: float) -> Any:
        """Makes the call, changed by the fault while it is active."""
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
        """Returns whether the fault is active at a time."""
        return self.fault.from_s - 1e-9 <= now_s < self.fault.to_s - 1e-9

    def concerns(self, verb: str, arguments: tuple[Any, ...]) -> bool:
        """Returns whether the fault affects a call."""
        if verb == "image" and self.fault.source not in (None, *arguments[:1]):
            return False
        return verb in self.fault.effect.verbs | self.fault.effect.always


class FaultyRobot(RobotWrapper):
    """Robot with injected faults, whose times count from `since_s`. `inject_faults` creates one."""

    def __init__(self, robot: Robot, clock: Clock, faults: Sequence[Fault], since_s: float) -> None:
        super().__init__(robot)
        self._clock, self._since_s = clock, since_s
        self._armed = [_Armed(fault) for fault in faults]

    def faults_at_work(self) -> tuple[str, ...]:
        """Words of the faults that are active now; a fault "after N calls" is active from the next call on."""
        now_s = self._clock.now() - self._since_s
        return tuple(each.fault.words for each in self._armed if each.on(now_s) and each.seen >= each.fault.calls)

    def _call(self, verb: str, call: Callable[..., AnswerT], *arguments: Any, **options: Any) -> AnswerT:
        """Makes a call through all faults that affect the verb, the first one outermost."""
        proceed: Callable[[], AnswerT] = partial(call, *arguments, **options)
        now_s = self._clock.now() - self._since_s
        for armed in reversed(self._armed):
            if armed.concerns(verb, arguments):
                through = Call(self._robot, verb, proceed, arguments, options, armed.memory)
                proceed = partial(armed.through, through, now_s)
        return proceed()


def inject_faults(robot: Robot, clock: Clock, faults: Sequence[Fault | str], *, since_s: float | None = None) -> Robot:
    """Wraps the robot with these faults, given as words or parsed; their times count from now, or from `since_s`.

    Raises ValueError when the words name no fault of this robot.
    """
    named = any(isinstance(fault, str) for fault in faults)
    cameras = [camera.source for camera in robot.capabilities().cameras] if named else []
    parsed = [parse_fault(fault, cameras=cameras) if isinstance(fault, str) else fault for fault in faults]
    begun_s = clock.now() if since_s is None else since_s
    return FaultyRobot(robot, clock, parsed, begun_s) if parsed else robot
