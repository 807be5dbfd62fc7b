"""Snapshots of a robot's tree in the form of py_trees_ros, whose viewer and tree watcher show them."""

from __future__ import annotations

import uuid
from typing import Any, Final

import numpy as np
from py_trees.common import Status
from py_trees.decorators import Decorator

from errand_ros2.messages import Fields, time_of
from errand_ros2.wire.node import Node
from errand_ros2.wire.types import LATCHED
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec, Snapshot

_TYPES: Final = "py_trees_ros_interfaces"
_STATUS: Final = {Status.INVALID: 1, Status.RUNNING: 2, Status.SUCCESS: 3, Status.FAILURE: 4}
_LEAF, _SEQUENCE, _SELECTOR, _DECORATOR, _NOT_A_BLACKBOX = 1, 2, 3, 6, 4


class TreeTopic:
    """Publisher of one robot's tree, and the services `open`, `close` and `reconfigure` by which viewers find it."""

    def __init__(self, node: Node) -> None:
        self._out = node.publisher("tree/snapshots", f"{_TYPES}/msg/BehaviourTree", LATCHED)
        self._last: Any = None
        opened, done = {"topic_name": node.absolute("tree/snapshots")}, {"result": True}
        node.answer("tree/snapshot_streams/open", f"{_TYPES}/srv/OpenSnapshotStream", lambda _: opened)
        node.answer("tree/snapshot_streams/close", f"{_TYPES}/srv/CloseSnapshotStream", lambda _: done)
        node.answer("tree/snapshot_streams/reconfigure", f"{_TYPES}/srv/ReconfigureSnapshotStream", lambda _: done)

    def put(self, now_s: float, tree: CompiledTree, states: Snapshot) -> None:
        """Publishes a tree of which a state has changed; late viewers get the last one."""
        if (seen := (tree.mission_name, states)) != self._last:
            self._out.put(snapshot(now_s, tree.root, states))
        self._last = seen


def snapshot(now_s: float, root: NodeSpec, states: Snapshot) -> Fields:
    """Returns a tree with the states of its nodes (py_trees_ros_interfaces/BehaviourTree)."""
    parents = {child.path_id: _id(node) for node in root.walk() for child in node.children}
    every = [_behaviour(node, states) | {"parent_id": parents.get(node.path_id)} for node in root.walk()]
    return {"behaviours": every, "changed": True, "statistics": {"stamp": time_of(now_s)}}


def _behaviour(node: NodeSpec, states: Snapshot) -> Fields:
    state, kind = states[node.path_id], _SEQUENCE if node.children else _LEAF
    kind = _SELECTOR if node.behaviour.control == "Fallback" else kind
    kind = _DECORATOR if issubclass(node.behaviour, Decorator) else kind
    running = (_id(each) for each in node.children if states[each.path_id].status is Status.RUNNING)
    told = {"status": _STATUS[state.status], "message": state.message, "is_active": state.status is Status.RUNNING}
    names = {"name": node.name, "class_name": node.kind, "type": kind, "blackbox_level": _NOT_A_BLACKBOX}
    names["additional_detail"] = "WithMemory" if node.children else ""
    links = {"own_id": _id(node), "child_ids": [*map(_id, node.children)], "current_child_id": next(running, None)}
    return names | told | links


def _id(node: NodeSpec) -> Fields:
    return {"uuid": np.frombuffer(uuid.uuid5(uuid.NAMESPACE_OID, node.path_id).bytes, np.uint8)}
