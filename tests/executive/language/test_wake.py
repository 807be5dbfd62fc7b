import pytest

from executive.language.wake import strip_wake


@pytest.mark.parametrize(
    ("text", "rest"),
    [
        ("Hey Alice, fetch me a drink", "fetch me a drink"),
        ("hey alice fetch me a drink", "fetch me a drink"),
        ("Hi Alice! fetch me a drink", "fetch me a drink"),
        ("OK, Alice, fetch me a drink", "fetch me a drink"),
        ("Alice, fetch me a drink", "fetch me a drink"),
        ("Alice please fetch me a drink", "please fetch me a drink"),
        ("fetch me a drink, Alice", "fetch me a drink"),
        ("please, hey Alice, fetch me a drink", "please, fetch me a drink"),
        ("fetch me a drink hey alice", "fetch me a drink"),
    ],
)
def test_the_wake_phrase_is_taken_out_where_it_stands(text, rest):
    result = strip_wake(text, "Alice")
    assert (result.text, result.addressed) == (rest, True)


@pytest.mark.parametrize(
    "text",
    [
        "fetch me a drink",
        "Hey Bob, fetch me a drink",
        "hey, bring Alice a drink",
        "Alicent, fetch me a drink",
        "they alice fetch me a drink",
    ],
)
def test_other_sentences_are_not_for_this_robot(text):
    result = strip_wake(text, "Alice")
    assert (result.text, result.addressed) == (text, False)


def test_a_bare_name_without_a_comma_does_not_wake():
    result = strip_wake("Alice fetch me a drink", "Alice")
    assert (result.text, result.addressed) == ("fetch me a drink", False)


def test_it_is_told_who_else_was_called():
    assert strip_wake("Hey Bob, fetch me a drink", "Alice").other_name == "Bob"
    assert strip_wake("fetch me a drink", "Alice").other_name is None


def test_a_name_of_any_characters_is_taken_literally():
    assert strip_wake("Hey R2.D2, come here", "R2.D2").addressed
    assert not strip_wake("Hey R2xD2, come here", "R2.D2").addressed
