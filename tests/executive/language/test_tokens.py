import pytest

from executive.language.tokens import name_table, parse_with_names, rephrase
from tests.tables import table


@pytest.fixture(scope="module")
def names(knowledge):
    return name_table(knowledge)


@pytest.mark.parametrize(*table(__file__, "names"))
def test_a_known_name_of_several_words_is_one_token(parser, names, text, known, tokens):
    assert [token.text for token in parse_with_names(text, parser.parse, names if known else None)] == tokens


def test_a_plural_keeps_its_singular_as_lemma(parser, names):
    token = parse_with_names("bring two wrenches", parser.parse, names)[-1]
    assert (token.text, token.lemma, token.tag) == ("wrenches", "wrench", "NNS")


def test_a_person_in_lower_case_is_a_name(parser, names):
    token = parse_with_names("give robin a coke", parser.parse, names)[1]
    assert (token.text, token.pos, token.entity) == ("robin", "PROPN", "PERSON")


def test_relations_are_named_in_the_usual_way(parser):
    relations = {token.text: token.relation for token in parser.parse("Alice brings me a drink from the kitchen")}
    wanted = {"Alice": "nsubj", "brings": "root", "me": "iobj", "drink": "obj", "kitchen": "obl"}
    assert {word: relations[word] for word in wanted} == wanted


@pytest.mark.parametrize(*table(__file__, "tags"))
def test_wrong_tags_are_repaired_and_right_ones_stay(parser, text, word, pos):
    assert {token.text: token.pos for token in parser.parse(text)}[word] == pos


@pytest.mark.parametrize("text", ["go to the counter look for the bowl", "put the soap on the bathroom sink"])
def test_every_word_still_hangs_on_a_root(parser, text):
    tokens = parser.parse(text)
    for token in tokens:
        for _ in tokens:
            token = tokens[token.head]
        assert token.head == token.index


@pytest.mark.parametrize(*table(__file__, "polite_forms"))
def test_polite_forms_become_plain_commands(text, command):
    assert rephrase(text) == command


def test_a_letter_is_a_name_only_in_its_own_case_and_behind_a_word(parser, knowledge):
    pose = next(iter(knowledge.places.values()))
    table = name_table(knowledge.model_copy(update={"places": {**knowledge.places, "A": pose}}))
    known = lambda text: [t.text for t in parse_with_names(text, parser.parse, table) if t.known]  # noqa: E731
    assert (known("go to A"), known("A beer please"), known("bring a beer to A")) == (["A"], ["beer"], ["beer", "A"])
