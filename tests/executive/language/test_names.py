import pytest

from executive.language.names import name_table, parse_with_names


@pytest.fixture(scope="module")
def table(knowledge):
    return name_table(knowledge)


def test_a_known_name_of_several_words_is_one_token(parser, table):
    tokens = parse_with_names("put the coke can on the kitchen counter", parser, table)
    assert [token.text for token in tokens] == ["put", "the", "coke can", "on", "the", "kitchen counter"]


def test_a_plural_keeps_its_singular_as_lemma(parser, table):
    token = parse_with_names("bring two wrenches", parser, table)[-1]
    assert (token.text, token.lemma, token.tag) == ("wrenches", "wrench", "NNS")


def test_a_person_in_lower_case_is_a_name(parser, table):
    token = parse_with_names("give robin a coke", parser, table)[1]
    assert (token.text, token.pos, token.entity) == ("robin", "PROPN", "PERSON")


def test_names_inside_other_words_are_left_alone(parser, table):
    assert "cokernut" in [token.text for token in parse_with_names("bring the cokernut", parser, table)]


def test_without_a_table_the_text_is_parsed_as_it_is(parser):
    tokens = parse_with_names("put the coke can down", parser, None)
    assert [token.text for token in tokens] == ["put", "the", "coke", "can", "down"]


def test_relations_are_named_in_the_usual_way(parser):
    tokens = parser.parse("Alice brings me a drink from the kitchen")
    relations = {token.text: token.relation for token in tokens}
    assert [relations[w] for w in ("Alice", "brings", "me", "drink", "kitchen")] == [
        "nsubj",
        "root",
        "iobj",
        "obj",
        "obl",
    ]
