import json
from xml.etree import ElementTree

import pytest

from executive.language.explain import arcs_svg, explain, explanation_lines, tree_lines
from executive.language.understand import understand
from tests.tables import table

SVG = "{http://www.w3.org/2000/svg}"
SENTENCE = "could you give Robin the hammer from the workshop, and bring two cokes here"


@pytest.fixture(scope="module")
def trace(parser, knowledge):
    return understand(SENTENCE, parser=parser, knowledge=knowledge, require_wake=False).trace


@pytest.fixture
def explained(trace):
    return explain(trace)


def trace_open(sentence, parser):
    return understand(sentence, parser=parser, knowledge=None, require_wake=False).trace


def test_polite_words_are_left_out(explained):
    assert explained["plain"].startswith("give Robin the hammer")
    assert explained["subject"] == "you (the robot)"


def test_each_word_has_its_tag_relation_and_head(explained):
    words = {token["text"]: token for token in explained["tokens"]}
    assert (words["hammer"]["pos"], words["hammer"]["relation"]) == ("NOUN", "obj")
    assert explained["tokens"][words["hammer"]["head"]]["text"] == "give"
    assert words["give"]["head"] is None
    assert [words[name]["kind"] for name in ("hammer", "workshop", "Robin")] == ["thing", "place", "person"]


def test_each_action_has_its_roles_in_plain_values(explained):
    give, bring = explained["actions"]
    roles = ("asks_for", "source", "recipient", "goal")
    assert [give[role] for role in roles] == ["single_trip", "from workshop", "Robin", None]
    assert (bring["objects"], bring["recipient"]) == ([{"name": "cokes", "count": 2}], "start")
    assert json.loads(json.dumps(explained)) == explained


def test_command_frames_keep_the_spoken_names_and_commands_the_worlds(explained):
    assert "Take [Nothing] to [Nothing] and do [grasp] to [2 cokes]" in explained["frames"]
    assert explained["commands"].count("Take [Nothing] to [kitchen] and do [grasp] to [coke]") == 2  # one by one


def test_explanation_gives_the_meaning_of_pronouns(parser):
    explained = explain(trace_open("take the coat and the hat and bring them there, go to the attic", parser))
    assert explained["refused_at"] == "reference"
    explained = explain(trace_open("go to the attic, take the red coat and put it in the bag", parser))
    assert explained["stands_for"] == [["it", "red coat"]]


@pytest.mark.parametrize(*table(__file__, "refused_at", ("word " * 100, "cleaning", False)))
def test_the_step_that_refused_is_named(parser, knowledge, sentence, step, known):
    names = knowledge if known else None
    explained = explain(understand(sentence, parser=parser, knowledge=names, require_wake=False).trace)
    assert (explained["refused_at"], bool(explained["reason"]), explained["commands"]) == (step, True, [])


def test_the_text_has_all_steps_and_the_tree(trace):
    lines = list(explanation_lines(trace))
    headings = [line for line in lines if not line.startswith(" ")]
    wanted = "heard, in plain words, words, dependencies, subject, parts, actions, command frames, where each word went"
    assert headings == [f"{name}:" for name in (*wanted.split(", "), "commands")]
    assert "  ├─ obj: hammer (NOUN)" in lines


def test_every_word_stands_once_in_the_tree(trace):
    assert len(list(tree_lines(trace.tokens))) == len(trace.tokens)


def test_the_drawing_has_every_word_and_an_arc_for_each_relation(trace):
    drawing = ElementTree.fromstring(arcs_svg(trace.tokens))
    texts = [e.text for e in drawing.iter(f"{SVG}tspan") if e.get("class") == "displacy-word"]
    arcs = [e for e in drawing.iter(f"{SVG}path") if e.get("class") == "displacy-arc"]
    assert texts == [token.text for token in trace.tokens]
    assert len(arcs) == sum(token.head != token.index for token in trace.tokens)


def test_odd_characters_stay_text_in_the_drawing(parser):
    drawing = ElementTree.fromstring(arcs_svg(trace_open("bring 'a & b' to <me>", parser).tokens))
    assert drawing.tag.endswith("svg")
