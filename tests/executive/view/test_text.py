"""Large trees are folded where nothing is to be seen; colours of states stay apart without colour vision."""

import re
from itertools import combinations

import numpy as np
import pytest
from py_trees.common import Status

from executive.tree.compiler import compile_mission
from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, node_view, outline
from executive.view.formats import to_svg
from executive.view.text import Styles, executed_tree, fold_below, fold_to, readable, to_text
from executive.words.mission import Mission
from skills.api import Cause, Failed

DONE, IDLE = NodeState(Status.SUCCESS), NodeState()
RUNS, FAILED = NodeState(Status.RUNNING), NodeState(Status.FAILURE, Cause.PLANNING, "no way")
# Linear RGB as seen with one kind of cone missing (Machado and others, 2009, severity 1).
CONES = {
    "all": np.eye(3),
    "no M cones": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no L cones": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no S cones": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


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


def linear(colour: str) -> np.ndarray:
    values = np.array([int(colour[n : n + 2], 16) for n in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    ratios = XYZ @ np.clip(rgb, 0, 1) / np.array([0.9505, 1.0, 1.089])
    x, y, z = np.where(ratios > 0.008856, np.cbrt(ratios), 7.787 * ratios + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("cones", CONES)
def test_line_colours_stay_apart_for_every_kind_of_colour_vision(cones):
    seen = {style.name: lab(np.array(CONES[cones]) @ linear(style.value.line)) for style in Styles}
    distances = {(a, b): np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(seen, 2)}
    assert min(distances.values()) > 15, distances


@pytest.mark.parametrize("style", Styles)
def test_words_are_readable_on_their_fill(style):
    ink, fill = (XYZ[1] @ linear(colour) for colour in (style.value.ink, style.value.fill))
    assert (fill + 0.05) / (ink + 0.05) > 4.5


def test_every_state_has_its_own_symbol_and_kind_of_line():
    for attribute in ("word", "symbol", "ascii", "line", "dashes"):
        values = [getattr(style.value, attribute) for style in Styles]
        if attribute == "dashes":
            values = [(style.value.dashes, style is Styles.FAILURE) for style in Styles]  # a failure's line is thicker
        assert len(set(values)) == len(values)
