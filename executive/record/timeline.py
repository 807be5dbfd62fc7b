"""Timeline of a run from its event log, for people."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from executive.record.history import logged_activity, logged_state, robot_of
from executive.record.reader import Event
from executive.record.schemas import (
    ACTIVITY,
    CONTROL,
    DESTINATION,
    ERRORS,
    MISSIONS,
    OUTCOME,
    RUN,
    SPEECH,
    TASK,
    TO_DETECT,
    TRANSITIONS,
    TREE,
    WALL,
)
from executive.tree.snapshot import NodeState


@dataclass(frozen=True)
class Entry:
    """One line of a timeline: time on the robot's clock (s), node or topic, and text.

    `state` is the node's state after a change, `robot` the robot's name.
    """

    t: float
    about: str
    text: str
    state: NodeState | None = None
    robot: str = ""


def timeline(events: Iterable[Event], *, leaves_only: bool = False) -> Iterator[Entry]:
    """The entries of a log in order.

    `leaves_only` omits changes of inner nodes that did not fail, and single late ticks.
    """
    return (replace(entry, robot=robot_of(event)) for event, entry in _entries(events, leaves_only))


def _entries(events: Iterable[Event], leaves_only: bool) -> Iterator[tuple[Event, Entry]]:
    inner: set[str] = set()
    commands: Sequence[str] = ()
    for event in events:
        if event.topic == RUN:
            commands = event.data.get("commands", ())
        if event.topic == TREE:
            inner |= _inner_nodes(event.data["root"])
        if event.topic == TRANSITIONS:
            entry = _transition(event)
            if not leaves_only or entry.about not in inner or (entry.state is not None and entry.state.cause):
                yield event, entry
        elif event.topic == ACTIVITY:
            state = logged_activity(event.data)
            yield event, Entry(event.data.get("t", event.stamp_s), event.data["node"], state.message, state)
        elif event.topic == TASK:
            yield event, Entry(event.stamp_s, event.topic, _task(event.data, commands))
        elif event.topic in _TEXTS and not (leaves_only and event.topic == WALL and "wall_time_s" not in event.data):
            text = _TEXTS[event.topic](event.data)
            if text:
                yield event, Entry(event.stamp_s, event.topic, text)


def _inner_nodes(structure: Mapping[str, Any]) -> set[str]:
    below = [_inner_nodes(child) for child in structure["children"]]
    return set().union(*below) | ({structure["id"]} if structure["children"] else set())


def _transition(event: Event) -> Entry:
    data = event.data
    state = logged_state(data)
    cause = state.cause.value if state.cause else ""
    return Entry(data.get("t", event.stamp_s), data["node"], ": ".join(filter(None, (cause, state.message))), state)


def _run(data: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in data.get("versions", {}).items())
    scenario = "".join(f"; {line}" for line in data.get("scenario", ()))
    return f"world {data.get('world')}, seed {data.get('seed')}; {versions}{scenario}"


def _mission(data: Mapping[str, Any]) -> str:
    return f"{data.get('id')} ({data.get('robot') or 'nobody'}): {data.get('outcome')}"


def _outcome(data: Mapping[str, Any]) -> str:
    cause = f" ({data['cause']})" if data.get("cause") else ""
    return f"{data.get('robot')}: {data.get('outcome')}{cause}: {data.get('message')}"


def _task(data: Mapping[str, Any], commands: Sequence[str]) -> str:
    number = int(data.get("task_count", 0))
    text = commands[number - 1] if 1 <= number <= len(commands) else f"objects {data.get('obj_type')}"
    return f"command {number} of {data.get('mission_count')} for {data.get('robot_name')}: {text}"


def _seen(data: Mapping[str, Any]) -> str:
    x, y, z = (data.get(f"goal_{axis}") or 0.0 for axis in "xyz")
    return f"{data.get('class_name')} at ({x:.2f}, {y:.2f}, {z:.2f}) m"


def _ticks(data: Mapping[str, Any]) -> str:
    late = [tick for tick in data.get("tick_s", ()) if tick > (data.get("limit_s") or float("inf"))]
    longest = f"longest {max(late) * 1e3:.0f} ms" if late else ""
    if "wall_time_s" in data:
        return f"{data['wall_time_s']:.1f} s on the wall's clock, {data.get('overruns')} ticks overran"
    return f"{len(late)} ticks overran; {longest}" if late else ""


_TEXTS: Final[Mapping[str, Callable[[Mapping[str, Any]], str]]] = {
    RUN: _run,
    OUTCOME: _outcome,
    SPEECH: lambda data: f'{data.get("robot")} says: "{data.get("text")}"',
    MISSIONS: lambda data: "; ".join(_mission(each) for each in data.get("missions", ())),
    CONTROL: lambda data: f"{data.get('what')}: {data.get('message')}",
    TO_DETECT: lambda data: f"look for {', '.join(data.get('class_name', ()))}",
    DESTINATION: _seen,
    ERRORS: lambda data: str(data.get("traceback", "")).strip().splitlines()[-1:][0] if data else "",
    WALL: _ticks,
}
