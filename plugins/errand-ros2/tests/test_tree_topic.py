"""A tree as the message that viewers of py_trees_ros show."""

from types import SimpleNamespace

from py_trees.common import Status

from errand_ros2.tree_topic import TreeTopic, snapshot
from errand_ros2.wire.types import LATCHED, ros_types
from executive.testing.bench import room_knowledge
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.mission import Mission

TREE = "py_trees_ros_interfaces/msg/BehaviourTree"
NAMES = ros_types().store.types["py_trees_ros_interfaces/msg/Behaviour"]
"""By whose constants viewers tell states and types."""


def test_a_snapshot_has_the_nodes_of_the_tree_with_their_links_and_states():
    steps = [{"speak": "Hello"}, {"speak": "Bye"}]
    mission = Mission.model_validate({"name": "greet", "robot": "Alice", "steps": steps})
    root = compile_mission(mission, knowledge=room_knowledge(), registry=installed_skills()).root
    leaf = next(node for node in root.walk() if not node.children)
    on_the_way = {node.path_id for node in root.walk() if leaf.path_id.startswith(node.path_id)}
    states = {
        node.path_id: SimpleNamespace(
            status=Status.RUNNING if node.path_id in on_the_way else Status.INVALID, message="speaking"
        )
        for node in root.walk()
    }
    kind = ros_types().message(TREE)
    told = kind.decode(kind.encode(snapshot(2.5, root, states)))
    found = {each.own_id.uuid.tobytes(): each for each in told.behaviours}
    assert len(found) == len(told.behaviours) == len([*root.walk()])
    top = told.behaviours[0]
    assert not any(top.parent_id.uuid)
    assert (told.changed, told.statistics.stamp.sec) == (True, 2)
    for each in told.behaviours:
        for child in each.child_ids:
            assert found[child.uuid.tobytes()].parent_id.uuid.tobytes() == each.own_id.uuid.tobytes()
    running = [each for each in told.behaviours if each.is_active]
    # the current children lead to the leaf that runs
    assert {each.status for each in running} == {NAMES.RUNNING} and len(running) == len(on_the_way)
    at = top
    while any(at.current_child_id.uuid):
        at = found[at.current_child_id.uuid.tobytes()]
    assert (at.name, at.type, at.message) == (leaf.name, NAMES.BEHAVIOUR, "speaking")
    assert {each.type for each in told.behaviours} >= {NAMES.BEHAVIOUR, NAMES.SEQUENCE}


def test_late_viewers_get_the_last_tree_without_which_those_of_py_trees_ros_take_none():
    published = []
    node = SimpleNamespace(publisher=lambda *given: published.append(given), absolute=str, answer=lambda *_: None)
    TreeTopic(node)
    assert published == [("tree/snapshots", TREE, LATCHED)]
