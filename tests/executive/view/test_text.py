"""Large trees are folded where nothing is to be seen, and never where something happens."""

import re

import pytest
from py_trees.common import Status

from executive.tree.compiler import compile_mission
from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, node_view, outline
from executive.view.formats import to_svg
from executive.view.text import executed_tree, fold_below, fold_to, readable, to_text
from executive.words.mission import Mission
from skills.api import Cause, Failed

DONE, IDLE = NodeState(Status.SUCCESS), NodeState()
RUNS, FAILED = NodeState(Status.RUNNING), NodeState(Status.FAILURE, Cause.PLANNING, "no way")


def step(number: int, state: NodeState, leaf_state: NodeState | None = None) -> NodeView:
    leaves = tuple(
        NodeView(f"r/{number}/{n}", "skill", f"leaf {n}", leaf_state or state if n == 0 else state) for n in range(10)
    )
    return NodeView(f"r/{number}", "sequence", f"step {number}", state, children=leaves)


def mission(*states: NodeState) -> NodeView:
    return NodeView("r", "sequence", "mission", RUNS, children=tuple(step(n, state) for n, state in enumerate(states)))


def shown(tree: NodeView) -> list[str]:
    return [node.path_id for _, node in tree.walk()]


def test_a_small_tree_is_shown_whole():
    tree = mission(DONE, IDLE)
    assert fold_to(tree, 100) == tree


def test_running_and_failed_nodes_stay_visible_and_the_rest_is_folded():
    tree = fold_to(mission(DONE, RUNS, FAILED, IDLE), 30)
    assert [child.hidden for child in tree.children] == [10, 0, 0, 10]
    assert {"r/1/0", "r/2/0"} <= set(shown(tree))


def test_nodes_that_have_not_begun_are_folded_before_those_that_succeeded():
    assert [child.hidden for child in fold_to(mission(DONE, RUNS, IDLE), 30).children] == [0, 0, 10]


def test_a_failure_below_a_node_that_succeeded_stays_visible():
    tree = NodeView("r", "sequence", "m", RUNS, children=(step(0, DONE, FAILED), step(1, DONE), step(2, DONE)))
    assert [child.hidden for child in fold_to(tree, 15).children] == [0, 10, 10]


def test_an_idle_tree_is_folded_from_its_deepest_level():
    tree = fold_to(NodeView("top", "sequence", "top", IDLE, children=(mission(IDLE, IDLE),)), 12)
    assert shown(tree) == ["top", "r", "r/0", "r/1"] or shown(tree) == ["top", "r"]


def test_the_text_shows_the_number_of_hidden_nodes():
    assert "step 0 - (10 nodes)" in to_text(fold_to(mission(DONE, RUNS), 15))


@pytest.mark.parametrize(("depth", "count"), [(0, 1), (1, 3), (2, 23), (9, 23)])
def test_a_depth_cuts_and_counts(depth, count):
    tree = fold_below(mission(DONE, RUNS), depth)
    assert len(shown(tree)) == count
    assert tree.below == 22


def test_a_negative_depth_is_refused():
    with pytest.raises(ValueError, match="at least 0"):
        fold_below(mission(DONE), -1)


def test_the_picture_shows_the_number_of_hidden_nodes():
    assert "+ 10 nodes" in to_svg(fold_to(mission(DONE, RUNS), 15))


def node(kind: str, name: str, *children: NodeView, state: NodeState = DONE) -> NodeView:
    return NodeView(name, kind, name, state, children=children)


def kinds(tree: NodeView) -> list[tuple[str, str]]:
    return [(each.kind, each.name) for _, each in tree.walk()]


def test_the_executed_tree_leaves_out_nodes_that_only_pass_on_a_result():
    drive = node("recover", "go to the bench", node("skill", "navigate"), node("skill", "back_off", state=IDLE))
    search = node("selector", "find cube", node("only if known", "again", state=IDLE), node("sequence", "look", drive))
    tree = node(
        "interrupts", "watched", node("monitor", "lease"), node("sequence", "m", search, node("skill", "grasp"))
    )
    assert kinds(executed_tree(tree)) == [("sequence", "m"), ("skill", "go to the bench"), ("skill", "grasp")]


def test_the_executed_tree_keeps_every_failure():
    drive = node("recover", "go to the bench", node("skill", "navigate", state=FAILED), node("skill", "back_off"))
    tree = node("sequence", "m", drive, node("monitor", "lease", state=FAILED), state=FAILED)
    left = ["m", "go to the bench", "go to the bench", "back off", "lease"]
    assert [name for _, name in kinds(executed_tree(tree))] == left


def test_a_node_that_gives_another_reason_than_its_child_is_kept():
    gave_up = NodeState(Status.FAILURE, Cause.PLANNING, "given up after 3 attempts")
    tree = node("retry", "thrice", node("skill", "stow", state=FAILED), state=gave_up)
    assert kinds(executed_tree(tree)) == [("retry", "thrice"), ("skill", "stow")]


def test_a_title_says_where_and_with_what(compiled, make):
    tree = compiled(*make.FETCH)
    ran = executed_tree(node_view(tree.root, dict.fromkeys(tree.path_ids, DONE)))
    titles = {each.name for _, each in ran.walk()}
    assert {"go to the counter", "hand over (Robin; drink)"} <= titles, titles


def test_the_legend_fits_beside_a_single_node():
    svg = to_svg(node("skill", "go to the bench"))
    width = float(svg.split('width="', 1)[1].split('"', 1)[0])
    rightmost = max(map(float, re.findall(r'<text x="([0-9.]+)"', svg)))
    assert width - rightmost > 60


def author_rows(tree: NodeView) -> list[tuple[int, str, str]]:
    return [(depth, row.name, row.policy) for depth, row in tree.walk() if row.step]


def test_the_outline_has_one_row_for_each_step_of_the_author(knowledge, registry):
    # skip, retries and the containers of rounds and branches share the row of their step
    group = {"group": [{"to": "kitchen"}, {"wait": {"seconds": 5}}], "timeout": 60, "on_failure": "skip"}
    choice = {"if": {"object": "coke", "at": "kitchen"}, "then": [group]}
    steps = [{"repeat": {"times": 2}, "steps": [choice]}, {"to": "counter"}]
    mission = Mission.model_validate({"name": "round", "robot": "Alice", "guards": {"time": 90}, "steps": steps})
    tree = compile_mission(mission, knowledge=knowledge, registry=registry)
    policy = "skip it if it fails, within 60 s"
    assert author_rows(outline(node_view(tree.root))) == [
        (0, "round", "not after 90 s"),
        (1, "repeat 2 times", ""),
        (2, "choose coke at kitchen?", ""),
        (3, "then: group", policy),
        (4, "go to the kitchen", ""),
        (4, "wait 5 s", ""),
        (1, "go to the counter", ""),
    ]


def test_a_readable_tree_folds_guards_and_what_carries_steps_out_but_no_step(compiled, make):
    whole = node_view(compiled(*make.FETCH).root)
    folded = readable(whole, 3)
    assert [row.step for _, row in folded.walk()] == [True, True, True]
    assert sum(1 + row.hidden for _, row in folded.walk()) < sum(1 for _ in whole.walk())
    assert not any(row.kind in ("monitor", "interrupt") for _, row in readable(whole, 80).walk())


def test_a_readable_tree_shows_what_failed_below_a_step(compiled, run_tree, make, script):
    script.ends["grasp"] = lambda skill: Failed(Cause.EXECUTION, "it slipped")
    tree = compiled(*make.FETCH)
    folded = readable(node_view(tree.root, run_tree(tree).worst.states), 3)
    assert any(row.name == "grasp" and row.state.message == "it slipped" for _, row in folded.walk())


def test_a_tree_without_steps_is_read_as_it_is():
    assert [row.name for _, row in readable(mission(DONE, IDLE), 100).walk()][:2] == ["mission", "step 0"]
