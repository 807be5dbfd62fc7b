"""Whatever stands in a name stays text, in every form of a tree."""

import json
import re
import xml.etree.ElementTree as ElementTree

import pytest
from py_trees.common import Status

from executive.record.history import Event
from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, Port, to_json
from executive.view.formats import to_btcpp, to_mermaid, to_svg
from executive.view.html import log_page
from executive.view.text import printable, to_text
from skills.api import Cause

NASTY = [
    '"><script>alert(1)</script>',
    "</script><!-- ]]>",
    "a & b < c > d ' e \" f",
    "end",
    "`**bold**` #quot; #35; %% comment",
    "subgraph x; n0 --> n1:::c",
    "{alice/key}",
    "two\nlines\tand a tab",
    "nul \x00 bell \x07 escape \x1b[31mred",
    "‮right to left‬ \u2028 separator",
    "ünï — 漢字 🤖",
    "-->",
    "Sequence",
    " ",
]


def tree_named(name: str) -> NodeView:
    failed = NodeState(Status.FAILURE, Cause.PLANNING, f"no way: {name}")
    leaf = NodeView("a/b/c", "skill", name, failed, ports=(Port(name, name, name), Port("ID", name, on_board=True)))
    again = NodeView("a/b/d", "skill", name, ports=(Port("x", "{text}"), Port("x", "key", output=True, on_board=True)))
    step = NodeView("a/b", "sequence", name, failed, children=(leaf, again))
    return NodeView("a", "sequence", name, failed, children=(step, NodeView("a/e", name, name)))


@pytest.mark.parametrize("name", NASTY)
def test_svg_stays_well_formed_and_shows_the_name(name):
    root = ElementTree.fromstring(to_svg(tree_named(name), title=name))
    titles = [title.text for title in root.iter("{http://www.w3.org/2000/svg}title")]
    assert len(titles) == 5
    assert f"PLANNING: no way: {printable(name)}" in (titles[2] or "")
    assert not [element for element in root.iter() if element.tag.endswith("script")]


@pytest.mark.parametrize("name", NASTY)
def test_mermaid_has_one_quoted_label_for_each_node_and_nothing_else(name):
    lines = to_mermaid(tree_named(name)).splitlines()
    body = [line for line in lines[1:] if "classDef" not in line]
    nodes = [match for line in body if (match := re.fullmatch(r'  n\d+\["([^"]*)"\]:::[a-z]+', line))]
    arrows = [line for line in body if re.fullmatch(r"  n\d+ --> n\d+", line)]
    assert (len(nodes), len(arrows), len(body)) == (5, 4, 9)
    label = re.sub(r"#(\d+);", lambda match: chr(int(match[1])), nodes[2][1].replace("<br/>", "\n"))
    assert label.splitlines()[0].endswith(printable(name).splitlines()[0] if printable(name).strip() else " ")


@pytest.mark.parametrize("name", NASTY)
def test_xml_stays_well_formed_with_names_that_the_format_allows(name):
    root = ElementTree.fromstring(to_btcpp(tree_named(name)))
    for element in root.iter():
        if "ID" in element.attrib:
            assert re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", element.attrib["ID"])
    action = next(element for element in root.iter("Action") if element.get("name") is not None)
    assert action.get("name") == printable(name)


@pytest.mark.parametrize("name", NASTY)
def test_text_has_one_line_for_each_node_and_no_control_characters(name):
    lines = to_text(tree_named(name)).split("\n")
    assert len(lines) == 5
    assert all(line.isprintable() for line in lines)


@pytest.mark.parametrize("name", NASTY)
def test_json_keeps_the_name_as_it_is(name):
    assert json.loads(json.dumps(to_json(tree_named(name))))["children"][0]["name"] == name


@pytest.mark.parametrize("name", NASTY)
def test_a_page_of_one_file_keeps_names_within_its_data(name):
    events = (Event("tree", 0.0, {"robot": "Alice", "root": tree_named(name).structure()}),)
    page = log_page(events)
    data = re.search(r'<script id="recorded" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert json.loads(data[1])["messages"][0]["data"]["root"]["name"] == name
    assert "<script>alert(1)" not in page
