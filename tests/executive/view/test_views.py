"""Text, SVG and JSON of a tree before and after it ran."""

import json
import xml.etree.ElementTree as ElementTree

import pytest
from py_trees.common import Status

from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, logged_view, node_view, to_json
from executive.view.formats import to_svg
from executive.view.text import Styles, style_of, to_rich, to_text
from skills.api import Cause, Failed


@pytest.fixture
def failed(compiled, run_tree, make, script) -> NodeView:
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand <here> & there")
    tree = compiled(*make.FETCH)
    return node_view(tree.root, run_tree(tree).worst.states)


def test_text_shows_status_cause_and_sentence_once(failed):
    lines = to_text(failed).splitlines()
    assert lines[0].startswith("✗ ") and lines[0].endswith(" - TIMEOUT")
    assert sum("no room to stand" in line for line in lines) == 1
    assert any(line.endswith("✗ approach - TIMEOUT: no room to stand <here> & there") for line in lines)
    assert len(lines) == sum(1 for _ in failed.walk())


def test_ascii_text_is_ascii(failed):
    text = to_text(failed, ascii_only=True)
    assert text.isascii()
    assert text.startswith("[x] ")


def test_collapsed_view_hides_what_is_done_or_not_begun(failed):
    shown = to_rich(failed).plain
    assert "look at the counter" not in shown
    assert "selector find the drink" in shown
    assert "nodes)" in shown


def test_svg_is_well_formed_and_has_every_node(failed):
    root = ElementTree.fromstring(to_svg(failed, title="a <title> & more"))
    ids = [group.get("data-id") for group in root.iter("{http://www.w3.org/2000/svg}g") if group.get("data-id")]
    assert ids == [node.path_id for _, node in failed.walk()]
    assert "TIMEOUT: no room to stand" in " ".join(root.itertext())


def test_svg_boxes_do_not_overlap(failed):
    root = ElementTree.fromstring(to_svg(failed))
    boxes = []
    for group in root.iter("{http://www.w3.org/2000/svg}g"):
        if group.get("data-id"):
            x, y = map(float, group.get("transform")[10:-1].split(","))
            frame = group.find("{http://www.w3.org/2000/svg}rect")
            boxes.append((x, y, float(frame.get("width")), float(frame.get("height"))))
    pairs = [(a, b) for n, a in enumerate(boxes) for b in boxes[n + 1 :]]
    assert not [
        (a, b)
        for a, b in pairs
        if a[0] < b[0] + b[2] and b[0] < a[0] + a[2] and a[1] < b[1] + b[3] and b[1] < a[1] + a[3]
    ]


def test_json_has_the_keys_of_the_contract(failed):
    root = json.loads(json.dumps(to_json(failed)))
    assert set(root) == {"id", "type", "name", "status", "cause", "source", "children"}
    assert root["id"].startswith("alice/fetch-drink")
    assert (root["status"], root["cause"], root["source"]) == ("FAILURE", "TIMEOUT", None)


def test_a_tree_that_has_not_run_is_idle(compiled, make):
    view = node_view(compiled(*make.FETCH).root)
    assert {node.state for _, node in view.walk()} == {NodeState()}


def test_states_differ_in_symbol_and_colour():
    styles = [style.value for style in Styles]
    for attribute in ("word", "symbol", "ascii", "line", "fill"):
        assert len({getattr(style, attribute) for style in styles}) == len(styles)


@pytest.mark.parametrize(
    ("state", "word"),
    [
        (NodeState(), "not run"),
        (NodeState(Status.INVALID, Cause.CANCELLED), "cancelled"),
        (NodeState(Status.RUNNING), "running"),
        (NodeState(Status.SUCCESS), "success"),
        (NodeState(Status.FAILURE, Cause.PLANNING), "failure"),
        (NodeState(Status.FAILURE, Cause.POSTCONDITION, expected=True), "found nothing"),
    ],
)
def test_style_of_each_state(state, word):
    assert style_of(state).word == word


NONE = NodeState(Status.FAILURE, Cause.POSTCONDITION, "no coke seen")
NO_WAY = NodeState(Status.FAILURE, Cause.PLANNING, "no way")
DONE, RUNS, BROKEN = NodeState(Status.SUCCESS), NodeState(Status.RUNNING), NodeState(Status.FAILURE)


def search(**states: NodeState) -> dict[str, str]:
    """Symbols of a mission whose step looks from two places, one after another: nodes by name."""

    def node(kind: str, name: str, *children: dict, step: bool = False) -> dict:
        return {"id": name, "type": kind, "name": name, "children": children, "step": step}

    first = node("sequence", "first", node("skill", "navigate"), node("skill", "detect"))
    second = node("sequence", "second", node("skill", "find_people"))
    step = node("answer", "step", node("selector", "find", first, second), step=True)
    view = logged_view(node("sequence", "mission", step, step=True), states)
    return {node.name: style_of(node.state).symbol for _, node in view.walk()}


@pytest.mark.parametrize("above", [DONE, RUNS])
def test_a_look_that_found_nothing_has_a_dash_in_a_success_and_while_the_search_goes_on(above):
    symbols = search(mission=above, step=above, find=above, first=NONE, navigate=DONE, detect=NONE)
    assert (symbols["first"], symbols["navigate"], symbols["detect"]) == ("–", "✓", "–")


def test_a_search_of_expected_failures_alone_has_a_dash_in_an_answer_of_no():
    symbols = search(mission=DONE, step=DONE, find=NONE, first=NONE, detect=NONE, second=NONE, find_people=NONE)
    assert {symbols[name] for name in ("find", "first", "detect", "second", "find_people")} == {"–"}


@pytest.mark.parametrize("mission", [BROKEN, RUNS])
def test_a_look_that_makes_its_step_fail_has_a_cross(mission):
    symbols = search(mission=mission, step=NONE, find=NONE, first=NONE, detect=NONE, second=NONE, find_people=NONE)
    assert {symbols[name] for name in ("step", "find", "first", "detect", "second", "find_people")} == {"✗"}


def test_any_other_failure_in_a_search_has_a_cross():
    lost = search(mission=DONE, step=DONE, find=NO_WAY, first=NO_WAY, navigate=NO_WAY, second=NONE, find_people=NONE)
    assert [lost[name] for name in ("find", "first", "navigate", "second", "find_people")] == ["✗", "✗", "✗", "–", "–"]
    blind = search(mission=DONE, step=DONE, find=DONE, first=BROKEN, detect=NodeState(Status.FAILURE, Cause.TIMEOUT))
    assert (blind["first"], blind["detect"]) == ("✗", "✗")
