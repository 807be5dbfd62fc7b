"""Reads event logs, even of a killed process: the trees at any time, a timeline, and the detected objects."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, Final

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from py_trees.common import Status
from zstandard import ZstdError

from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, logged_view
from executive.words.robot_config import find_robot
from executive.words.schemas import (
    ACTIVITY,
    CONTROL,
    DESTINATION,
    ERRORS,
    LIBRARY,
    MISSIONS,
    OUTCOME,
    RUN,
    SPEECH,
    TASK,
    TO_DETECT,
    TOPIC,
    TRACKS,
    TRANSITIONS,
    TREE,
    WALL,
)
from skills.api import Cause, ObjectKind, ObjectObservation
from skills.class_forms import ANY_OBJECT
from skills.descriptions import distinct_objects
from skills.inputs.errors import InputError
from skills.inputs.outside import plain_file

MOST_BYTES = 100_000_000_000
_EXISTS: Final = "name a log that exists"
RECORDING: Final = "recording.html"
_WRITTEN: Final = "name a log.mcap that a run has written"
_ROS_1: Final = b"#ROSBAG V2"
_SQLITE: Final = b"SQLite format 3"
_DAMAGE = (McapError, struct.error, ZstdError, ValueError, RecursionError)


@dataclass(frozen=True)
class Event:
    """Logged message: topic, time on the robot's clock (s), and values."""

    topic: str
    stamp_s: float
    data: dict[str, Any]


def read_events(path: Path) -> tuple[Event, ...]:
    """Reads all events in the order in which they were written; a truncated log is read up to its last whole event.

    Raises InputError if the file is missing or is no event log.
    """
    plain_file(path, most_bytes=MOST_BYTES, hint=_EXISTS)
    try:
        _refuse_other_logs(path)
        with path.open("rb") as file:
            return tuple(_events(NonSeekingReader(file)))
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", hint=_EXISTS, file=path) from error
    except _DAMAGE as error:
        raise InputError("it is no event log", hint=_WRITTEN, file=path) from error


def _refuse_other_logs(path: Path) -> None:
    """Raises InputError for a log of another program, and an error of the log reader for a damaged file."""
    with path.open("rb") as file:
        start = file.read(len(_ROS_1))
    kind = {_ROS_1: "a bag of ROS 1", _SQLITE[: len(_ROS_1)]: "a database, perhaps a bag of ROS 2"}.get(start)
    if kind is None:
        with path.open("rb") as file:
            header = NonSeekingReader(file).get_header()
        if header.library == LIBRARY:
            return
        profile = f", of the profile {header.profile[:20]}" if header.profile else ""
        kind = f"a log of another program ({header.library[:60] or 'which gives no name'}{profile})"
    raise InputError(f"it is {kind}", hint=_WRITTEN, file=path)


def _events(reader: NonSeekingReader) -> Iterator[Event]:
    count = 0
    try:
        for _, channel, message in reader.iter_messages(log_time_order=False):
            count += 1
            topic = channel.metadata.get(TOPIC, channel.topic)
            yield Event(topic, message.log_time / 1e9, json.loads(message.data))
    except _DAMAGE:
        if count == 0:
            raise


_KEYS: Final = ("node", "from", "to", "cause", "message")


@dataclass(frozen=True)
class History:
    """History of a run: the events read from one log, and the log's file."""

    file: Path
    events: tuple[Event, ...]

    def transitions(self) -> Iterator[dict[str, Any]]:
        """Yields the transitions of the nodes: `t` (s), `node`, `from`, `to`, `cause`, `message`."""
        for event in self.events:
            if event.topic == TRANSITIONS:
                yield {"t": event.data.get("t", event.stamp_s), **{key: event.data.get(key) for key in _KEYS}}

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots, in order."""
        return tuple(sorted({name for event in self.events if (name := robot_of(event))}))

    def of_robot(self, name: str) -> History:
        """Selects the events of one robot and the events that belong to no robot.

        Raises InputError if the log has no such robot.
        """
        known = find_robot(name, self.robots)
        if known is None:
            hint = f"there are: {', '.join(self.robots)}" if self.robots else "no robot's messages are in it"
            raise InputError(f"the log has no robot '{name[:60]}'", hint=hint, file=self.file)
        return replace(self, events=tuple(event for event in self.events if robot_of(event) in ("", known)))

    def trees(self, until_s: float | None = None) -> tuple[NodeView, ...]:
        """Returns the trees in the order in which they began, in their last state or at a time (s, robot's clock).

        Raises InputError if the log holds no tree, or a broken one.
        """
        found = list[_LoggedTree]()
        for event in self.events:
            if until_s is None or event.stamp_s <= until_s + 1e-9:
                _apply(event, found)
        if not found:
            raise InputError("the log holds no tree", hint="it ended before the mission began", file=self.file)
        try:
            return tuple(each.view() for each in found)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"the log's tree is broken ({error})", hint="run it again", file=self.file) from error


def robot_of(event: Event) -> str:
    """Name of the robot that an event belongs to; empty if it belongs to no robot."""
    return str(event.data.get("robot") or event.data.get("robot_name") or "")


def read_history(path: Path) -> History:
    """Reads the history of a run from its log, even a truncated one, or from its folder.

    The folder of a resumed run has several logs; this reads the last. Raises InputError where there is no log.
    """
    if path.is_dir():
        logs = sorted(path.resolve().glob("log*.mcap"), key=lambda log: (len(log.name), log.name))
        if not logs:
            raise InputError("it holds no log", hint="`errand runs` lists the runs", file=path)
        path = logs[-1]
    return History(path, read_events(path))


def logged_state(data: Mapping[str, Any]) -> NodeState:
    """State of a node after a logged transition; that of a running node by its latest activity, which has no `to`."""
    cause = data.get("cause")
    status = Status(data.get("to", Status.RUNNING.value))
    return NodeState(status, Cause(cause) if cause else None, data.get("message") or "")


@dataclass(frozen=True)
class _LoggedTree:
    """Tree as it was logged, and the states of its nodes by path id."""

    data: Mapping[str, Any]
    states: dict[str, NodeState] = field(default_factory=dict)

    def view(self) -> NodeView:
        """View of the tree. Raises KeyError, TypeError or ValueError if the logged tree is malformed."""
        return logged_view(self.data["root"], self.states)


def _apply(event: Event, found: list[_LoggedTree]) -> None:
    """Adds a logged tree, or applies a logged change of a node to the robot's latest tree."""
    if event.topic == TREE:
        found.append(_LoggedTree(event.data))
    elif event.topic in (TRANSITIONS, ACTIVITY) and found:
        _latest(found, event.data.get("robot")).states[event.data["node"]] = logged_state(event.data)


def _latest(found: Sequence[_LoggedTree], robot: Any) -> _LoggedTree:
    """The robot's latest tree, or the latest of all trees if the robot has none."""
    mine = [each for each in found if each.data.get("robot") == robot]
    return mine[-1] if mine else found[-1]


@dataclass(frozen=True)
class Entry:
    """Line of a timeline: time on the robot's clock (s), node or topic, and text.

    `state` is the node's state after a change, `robot` the robot's name.
    """

    t: float
    about: str
    text: str
    state: NodeState | None = None
    robot: str = ""


def timeline(events: Iterable[Event], *, leaves_only: bool = False) -> Iterator[Entry]:
    """Yields the lines of a log's timeline.

    With `leaves_only`, the timeline omits changes of inner nodes that did not fail, and ticks that took too long.
    """
    return (replace(entry, robot=robot_of(event)) for event, entry in _entries(events, leaves_only))


def _ticks_of(events: Iterable[Event]) -> Iterator[tuple[Sequence[Event], Collection[str]]]:
    """Yields the events of each tick, and the path ids of the failures that are expected at its end.

    Speech comes after the changes of nodes, although these are logged only when the tick ends.
    """
    found = list[_LoggedTree]()
    for _, group in groupby(events, key=attrgetter("stamp_s")):
        tick = sorted(group, key=lambda event: event.topic == SPEECH)
        for event in tick:
            _apply(event, found)
        failed = [each for each in tick if each.topic == TRANSITIONS and each.data["to"] == Status.FAILURE.value]
        trees = {id(tree): tree for each in failed if found and (tree := _latest(found, each.data.get("robot")))}
        nodes = [node for tree in trees.values() for _, node in tree.view().walk()]
        yield tick, {node.path_id for node in nodes if node.state.expected}


def _entries(events: Iterable[Event], leaves_only: bool) -> Iterator[tuple[Event, Entry]]:
    inner: set[str] = set()
    commands: Sequence[str] = ()
    for event, expected in ((event, expected) for tick, expected in _ticks_of(events) for event in tick):
        if event.topic == RUN:
            commands = event.data.get("commands", ())
        if event.topic == TREE:
            inner |= _inner_nodes(event.data["root"])
        if event.topic == TRANSITIONS:
            entry = _transition(event, expected)
            if not leaves_only or entry.about not in inner or (entry.state is not None and entry.state.cause_text):
                yield event, entry
        elif event.topic == ACTIVITY:
            state = logged_state(event.data)
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


def _transition(event: Event, expected: Collection[str]) -> Entry:
    state = logged_state(event.data)
    state = state._replace(expected=state.status is Status.FAILURE and event.data["node"] in expected)
    text = ": ".join(filter(None, (state.cause_text, state.message)))
    return Entry(event.data.get("t", event.stamp_s), event.data["node"], text, state)


def _run(data: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in data.get("versions", {}).items())
    scenario = "".join(f"; {line}" for line in data.get("scenario", ()))
    return f"world {data.get('world')}, seed {data.get('seed')}; {versions}{scenario}"


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
        return f"{data['wall_time_s']:.1f} s of wall-clock time, {data.get('overruns')} ticks took too long"
    return f"{len(late)} ticks took too long; {longest}" if late else ""


_TEXTS: Final[Mapping[str, Callable[[Mapping[str, Any]], str]]] = {
    RUN: _run,
    OUTCOME: _outcome,
    SPEECH: lambda data: f'{data.get("robot")} {"shows" if data.get("silent") else "says"}: "{data.get("text")}"',
    MISSIONS: lambda data: "; ".join(
        f"{each.get('id')} ({each.get('robot') or 'nobody'}): {each.get('outcome')}"
        for each in data.get("missions", ())
    ),
    CONTROL: lambda data: f"{data.get('what')}: {data.get('message')}",
    TO_DETECT: lambda data: f"look for {', '.join(data.get('class_name', ()))}",
    DESTINATION: _seen,
    ERRORS: lambda data: str(data.get("traceback", "")).strip().splitlines()[-1:][0] if data else "",
    WALL: _ticks,
}


def seen_objects(events: Iterable[Event]) -> tuple[ObjectObservation, ...]:
    """Returns the objects confirmed in a run, each once, in the order of the searches.

    An object is confirmed as in `detect`: seen from two viewpoints, and of the same most probable class at the end of
    the search. Objects without a class are omitted. Two objects of one class from different searches are the same if
    they are within `SAME_WITHIN_M`. Sizes are 0, because the log has none; the score is the probability of the class.
    """
    searches: list[list[ObjectObservation]] = []
    open_searches: dict[str, int] = {}
    for event in events:
        robot = str(event.data.get("robot_name", ""))
        if event.topic == TO_DETECT:
            open_searches[robot] = len(searches)
            searches.append([])
        elif event.topic == TRACKS and robot in open_searches:
            confirmed = (track for track in event.data["tracks"] if track.get("confirmed"))
            sure = [track for track in confirmed if track["class_name"] != ANY_OBJECT]
            searches[open_searches[robot]] = [_observation(track) for track in sorted(sure, key=itemgetter("number"))]
    return distinct_objects(searches)


def _observation(track: Mapping[str, Any]) -> ObjectObservation:
    x_m, y_m, z_m = track["position_W"]
    return ObjectObservation(
        stamp_s=float(track["last_seen_s"]),
        kind=ObjectKind(track["class_name"]),
        position_W=(x_m, y_m, z_m),
        size_m=(0.0, 0.0, 0.0),
        yaw_rad=0.0,
        score=float(track["belief"]),
        surface=track["surface"] or None,
    )
