"""History of a run from its event log: the trees at any time, and the transitions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from py_trees.common import Status

from executive.record.reader import Event, read_events
from executive.record.schemas import ACTIVITY, TRANSITIONS, TREE
from executive.tree.node_view import NodeView, logged_view
from executive.tree.snapshot import NodeState
from executive.words.robots import robot_called
from skills.api import Cause
from skills.files.errors import InputError

TRANSITION_KEYS = ("t", "node", "from", "to", "cause", "message")


@dataclass(frozen=True)
class History:
    """The events of one log, and its file."""

    file: Path
    events: tuple[Event, ...]

    def transitions(self) -> Iterator[dict[str, Any]]:
        """The transitions of the nodes: `t` (s), `node`, `from`, `to`, `cause`, `message`."""
        for event in self.events:
            if event.topic == TRANSITIONS:
                yield {"t": event.data.get("t", event.stamp_s), **_picked(event.data, TRANSITION_KEYS[1:])}

    @property
    def robots(self) -> tuple[str, ...]:
        """The names of the robots, in order."""
        return tuple(sorted({name for event in self.events if (name := robot_of(event))}))

    def of_robot(self, name: str) -> History:
        """The events of one robot, and those of no robot. Raises InputError if the log has no such robot."""
        known = robot_called(name, self.robots)
        if known is None:
            hint = f"there are: {', '.join(self.robots)}" if self.robots else "no robot's messages are in it"
            raise InputError(f"the log has no robot '{name[:60]}'", hint=hint, file=self.file)
        return replace(self, events=tuple(event for event in self.events if robot_of(event) in ("", known)))

    def trees(self, until_s: float | None = None) -> tuple[NodeView, ...]:
        """The trees in the order of their beginning, in their state at a time (s) of the robot's clock, or the last.

        Raises InputError: the log holds no tree, or a broken one.
        """
        found: list[tuple[dict[str, Any], dict[str, NodeState]]] = []
        for event in _before(self.events, until_s):
            if event.topic == TREE:
                found.append((event.data, {}))
            elif event.topic == TRANSITIONS and found:
                _latest(found, event.data.get("robot"))[event.data["node"]] = logged_state(event.data)
            elif event.topic == ACTIVITY and found:
                _latest(found, event.data.get("robot"))[event.data["node"]] = logged_activity(event.data)
        if not found:
            raise InputError("the log holds no tree", hint="it ended before the mission began", file=self.file)
        try:
            return tuple(logged_view(data["root"], states) for data, states in found)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"the log's tree is broken ({error})", hint="run it again", file=self.file) from error


def robot_of(event: Event) -> str:
    """Name of the robot that an event belongs to; empty if it belongs to none."""
    return str(event.data.get("robot") or event.data.get("robot_name") or "")


def read_history(path: Path) -> History:
    """Reads the history of a log, even of one that was cut off. Raises InputError for a file that is no log."""
    return History(path, read_events(path))


def logged_state(transition: dict[str, Any]) -> NodeState:
    """State of a node after a logged transition."""
    cause = transition.get("cause")
    return NodeState(Status(transition["to"]), None if not cause else Cause(cause), transition.get("message") or "")


def logged_activity(activity: dict[str, Any]) -> NodeState:
    """State of a running node with its latest logged message."""
    return NodeState(Status.RUNNING, None, activity.get("message") or "")


def _before(events: Iterable[Event], until_s: float | None) -> Iterator[Event]:
    return (event for event in events if until_s is None or event.stamp_s <= until_s + 1e-9)


def _latest(found: list[tuple[dict[str, Any], dict[str, NodeState]]], robot: Any) -> dict[str, NodeState]:
    """States of the robot's latest tree, or of the latest tree if no robot is named."""
    mine = [states for data, states in found if data.get("robot") == robot]
    return mine[-1] if mine else found[-1][1]


def _picked(data: dict[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    return {key: data.get(key) for key in keys}
