"""The XML follows the rules that BehaviorTree.CPP 4 checks when it loads a file, and tells states and ports."""

import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path

import pytest

from executive.tree.node_view import NodeView, node_view
from executive.view.formats import to_btcpp
from executive.view.text import fold_below
from skills.api import Cause, Failed
from skills.inputs.errors import SourceLine

CONTROLS = {"Sequence", "Fallback", "Control"}


@pytest.fixture
def document(compiled, make):
    return ElementTree.fromstring(to_btcpp(node_view(compiled(*make.FETCH).root)))


def nodes_of(document):
    """All nodes of all trees."""
    for tree in document.findall("BehaviorTree"):
        yield from list(tree.iter())[1:]


def test_root_names_the_format_and_a_main_tree_that_is_there(document):
    trees = [tree.get("ID") for tree in document.findall("BehaviorTree")]
    assert (document.tag, document.get("BTCPP_format")) == ("root", "4")
    assert document.get("main_tree_to_execute") == trees[0]
    assert len(set(trees)) == len(trees)


def test_numbers_of_children_are_those_that_the_format_allows(document):
    assert all(len(tree) == 1 for tree in document.findall("BehaviorTree"))
    for node in nodes_of(document):
        if node.tag in CONTROLS:
            assert len(node) >= 1
        elif node.tag == "Decorator":
            assert len(node) == 1
        else:
            assert node.tag in {"Action", "Condition", "SubTree"}
            assert len(node) == 0


def test_every_subtree_is_there_and_used_once(document):
    trees = [tree.get("ID") for tree in document.findall("BehaviorTree")]
    used = Counter(node.get("ID") for node in nodes_of(document) if node.tag == "SubTree")
    assert used == Counter(trees[1:])


def test_every_node_that_is_not_built_in_has_a_model_with_all_its_ports(document):
    (models,) = document.findall("TreeNodesModel")
    known = {(model.tag, model.get("ID")): {port.get("name") for port in model} for model in models}
    assert len(known) == len(models)
    for node in nodes_of(document):
        if node.tag not in {"Sequence", "Fallback"}:
            ports = {name for name in node.attrib if name not in {"ID", "name"} and not name.startswith("_")}
            assert ports <= known[node.tag, node.get("ID")]


def test_blackboard_keys_stand_in_braces_and_constants_do_not(document):
    detect = next(node for node in nodes_of(document) if node.get("ID") == "Detect")
    outputs = [detect.get(name, "") for name in ("observation", "observation_out")]
    assert any(key.startswith("{alice/") for key in outputs)
    assert not detect.get("classes", "{").startswith("{")


def test_every_path_id_stands_in_one_description(compiled, make, document):
    told = " ".join(node.get("_description", "") + " |" for node in nodes_of(document) if node.tag != "SubTree")
    for path_id in compiled(*make.FETCH).path_ids:
        assert told.count(f"| {path_id} |") == 1


def test_values_are_written_as_a_person_would_write_them(document):
    # records have words and units, truth values are lower case, path ids are relative, nothing is empty
    values = [(name, value) for node in nodes_of(document) for name, value in node.attrib.items()]
    ports = [value for name, value in values if name not in ("ID", "name") and not name.startswith("_")]
    goals = [node.get("goal") for node in nodes_of(document) if node.get("ID") == "Navigate"]
    assert any(re.fullmatch(r"x -?[\d.]+ m, y -?[\d.]+ m, yaw -?\d+°", goal or "") for goal in goals)
    assert "after EXECUTION or PLANNING of navigate, after EXECUTION or PLANNING of navigate" in ports
    assert not [value for value in ports if value in ("", "True", "False", "None") or "=" in value]
    assert not [value for value in ports if "alice/" in value and not value.startswith("{")]


def test_the_source_of_a_node_is_its_file_without_the_folder():
    node = NodeView("a/b", "sequence", "b", source=SourceLine(Path("/home/me/missions/round.yaml"), 3))
    document = to_btcpp(node)
    assert "round.yaml:3" in document
    assert "/home" not in document


def test_a_failed_node_shows_its_cause_and_message(compiled, run_tree, make, script):
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand")
    tree = compiled(*make.FETCH)
    document = ElementTree.fromstring(to_btcpp(node_view(tree.root, run_tree(tree).worst.states)))
    assert any("failure: TIMEOUT: no room to stand" in node.get("_description", "") for node in nodes_of(document))


def test_a_folded_composite_does_not_become_an_empty_sequence(compiled, make):
    document = ElementTree.fromstring(to_btcpp(fold_below(node_view(compiled(*make.FETCH).root), 1)))
    assert all(len(node) > 0 for node in nodes_of(document) if node.tag in CONTROLS)
    assert any("nodes below are left out" in node.get("_description", "") for node in nodes_of(document))
