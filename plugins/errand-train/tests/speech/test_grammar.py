"""The sentences that the recogniser is trained with."""

import random
import re

import pytest

from errand_train.speech.grammar import Grammar, load_grammar

WORDS = {
    "thing": ["cup"],
    "room": ["hall"],
    "surface": ["shelf"],
    "person": ["Ann"],
    "robot": ["Rex"],
    "adjective": ["old"],
}
FORMS = {
    "call": ["Hey <robot>, "],
    "polite": ["please "],
    "request": ["(get|get) <article> <adjective> <things>[ <from>]"],
    "article": ["a"],
    "from": ["from the <surface>"],
    "told": ["there is a <thing>, get it"],
    "said": ["<person> sees a <adjective> <thing>"],
}


@pytest.fixture(scope="module")
def sentences():
    grammar, draw = load_grammar(), random.Random(1)
    return [grammar.sentence(draw) for _ in range(2000)]


def test_sentences_are_written_as_the_recogniser_writes_them(sentences):
    for sentence in sentences:
        assert re.fullmatch(r"[A-Z][A-Za-z' ,-]*[A-Za-z][.?]", sentence.text), sentence.text
        assert "  " not in sentence.text and not re.search(r"\ba [aeiou]", sentence.text)


def test_sentences_differ_widely(sentences):
    assert len({sentence.text for sentence in sentences}) > 1900
    assert len({word for sentence in sentences for word in sentence.text.lower().split()}) > 1200


def test_most_names_are_in_the_prompt_and_some_are_not(sentences):
    told = [any(name in one.text for name in one.vocabulary.names if name[0].islower()) for one in sentences]
    assert 0.5 < sum(told) / len(told) < 0.95
    assert 0.02 < sum(not one.vocabulary.names for one in sentences) / len(sentences) < 0.2


def test_some_are_not_said_to_the_robot(sentences):
    called = [bool(one.vocabulary.robot_name and one.vocabulary.robot_name in one.text) for one in sentences]
    assert 0.4 < sum(called) / len(called) < 0.8


def test_the_same_draw_gives_the_same_sentence():
    grammar = load_grammar()
    first, second = (grammar.sentence(random.Random(9)) for _ in range(2))
    assert first == second


def test_words_for_validation_are_others():
    drawn = [
        {name for _ in range(500) for name in grammar.sentence(draw).vocabulary.names if name[0].islower()}
        for grammar, draw in ((load_grammar(), random.Random(1)), (load_grammar(validation=True), random.Random(2)))
    ]
    assert drawn[0] and drawn[1] and not drawn[0] & drawn[1]


def test_a_form_becomes_a_sentence_with_articles_and_plurals():
    grammar, draw = Grammar(WORDS, FORMS), random.Random(3)
    texts = {grammar.sentence(draw).text for _ in range(200)}
    assert texts <= {
        f"{call}{polite}{asked}."
        for call in ("Hey Rex, ", "")
        for polite in ("please ", "Please ", "")
        for asked in (
            *("get an old cups", "Get an old cups", "get an old cups from the shelf", "Get an old cups from the shelf"),
            *("there is a cup, get it", "There is a cup, get it", "Ann sees an old cup"),
        )
    }
    assert "Hey Rex, get an old cups." in texts and "Ann sees an old cup." in texts
