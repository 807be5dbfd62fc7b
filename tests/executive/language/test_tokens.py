import pytest

from executive.language.tokens import name_table, parse_with_names, rephrase


@pytest.fixture(scope="module")
def table(knowledge):
    return name_table(knowledge)


def test_a_known_name_of_several_words_is_one_token(parser, table):
    tokens = parse_with_names("put the coke can on the kitchen counter", parser.parse, table)
    assert [token.text for token in tokens] == ["put", "the", "coke can", "on", "the", "kitchen counter"]


def test_a_plural_keeps_its_singular_as_lemma(parser, table):
    token = parse_with_names("bring two wrenches", parser.parse, table)[-1]
    assert (token.text, token.lemma, token.tag) == ("wrenches", "wrench", "NNS")


def test_a_person_in_lower_case_is_a_name(parser, table):
    token = parse_with_names("give robin a coke", parser.parse, table)[1]
    assert (token.text, token.pos, token.entity) == ("robin", "PROPN", "PERSON")


def test_names_inside_other_words_are_left_alone(parser, table):
    assert "cokernut" in [token.text for token in parse_with_names("bring the cokernut", parser.parse, table)]


def test_without_a_table_the_text_is_parsed_as_it_is(parser):
    tokens = parse_with_names("put the coke can down", parser.parse, None)
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


def tags(parser, text):
    return {token.text: token.pos for token in parser.parse(text)}


@pytest.mark.parametrize(
    ("text", "word", "pos"),
    [
        ("put the soap on the bathroom sink", "sink", "NOUN"),
        ("put the garbage in the trash can", "can", "NOUN"),
        ("there are clean towels in the closet", "clean", "ADJ"),
        ("go to the counter look for the bowl", "look", "VERB"),
        ("head over to the bench pick up the pliers", "pick", "VERB"),
        ("navigate to the sink and bring it to skyler at the desk", "skyler", "PROPN"),
        ("go to the kitchen no to the bathroom", "no", "INTJ"),
    ],
)
def test_wrong_tags_are_repaired(parser, text, word, pos):
    assert tags(parser, text)[word] == pos


@pytest.mark.parametrize(
    ("text", "word", "pos"),
    [
        ("go to the kitchen and wait", "wait", "VERB"),
        ("the can is on the table", "can", "NOUN"),
        ("which hammer can you bring", "can", "AUX"),
        ("clean the towels", "clean", "VERB"),
        ("i want to know it", "know", "VERB"),
    ],
)
def test_right_tags_stay(parser, text, word, pos):
    assert tags(parser, text)[word] == pos


@pytest.mark.parametrize("text", ["go to the counter look for the bowl", "put the soap on the bathroom sink"])
def test_every_word_still_hangs_on_a_root(parser, text):
    tokens = parser.parse(text)
    for token in tokens:
        for _ in tokens:
            token = tokens[token.head]
        assert token.head == token.index


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("could you please get it", "get it"),
        ("Can you, please, get it?", "get it?"),
        ("there is one here can you get it", "there is one here , get it"),
        ("I would like a coke", "bring me a coke"),
        ("I would like you to get a coke", "get a coke"),
        ("I'd like something to drink", "bring me a drink"),
        ("get it please", "get it"),
        ("robot get it", "get it"),
        ("get it", "get it"),
    ],
)
def test_polite_forms_become_plain_commands(text, command):
    assert rephrase(text) == command
