from pathlib import Path

import pytest
import yaml

from executive.language.cleaning import clean, find_address, find_heard_wake, strip_wake


@pytest.mark.parametrize(
    ("text", "cleaned"),
    [
        ("  fetch\tme \n a drink ", "fetch me a drink"),
        ("don’t", "don't"),
        ("\x1b[31mfetch\x00 it", "31mfetch it"),
        ('fetch 🙂 [it] "now"', "fetch it now"),
        ("ﬁnd it", "find it"),
        ("i 'm here , do n't go", "i'm here , don't go"),
    ],
)
def test_text_becomes_plain(text, cleaned):
    assert clean(text) == cleaned


TABLE = yaml.safe_load(Path(__file__).with_name("wake.yaml").read_text(encoding="utf-8"))
ROBOTS = ("Alice", "Bob")
NOBODY = TABLE["nobody"]
CALLING = [(name, text) for name in ROBOTS for text in TABLE[name]]
MISSED_PER_100, FALSE_PER_100 = 3, 1


def test_of_a_hundred_calls_three_are_missed_at_most():
    missed = [text for name, text in CALLING if find_address(text, ROBOTS).name != name]
    assert len(missed) * 100 <= MISSED_PER_100 * len(CALLING), missed


def test_of_a_hundred_sentences_for_nobody_one_is_taken_at_most():
    assert len(NOBODY) >= 100
    taken = [text for text in NOBODY if find_address(text, ROBOTS).name is not None]
    assert len(taken) * 100 <= FALSE_PER_100 * len(NOBODY), taken


def test_of_several_robots_at_most_one_takes_a_sentence():
    others = {"Alice": ("Bob",), "Bob": ("Alice",)}
    for _, text in CALLING:
        takers = [name for name in ROBOTS if find_heard_wake(text, name, others=others[name]).name == name]
        assert len(takers) <= 1, text


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
        ("Please, Alice, fetch me a drink", "Please, fetch me a drink"),
        ("Alice", ""),
    ],
)
def test_the_wake_phrase_is_taken_out_where_it_stands(text, rest):
    result = strip_wake(text, "Alice")
    assert (result.text, result.name) == (rest, "Alice")


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
    assert result.text == text and result.name != "Alice"


def test_a_bare_name_without_a_comma_does_not_wake():
    result = strip_wake("Alice fetch me a drink", "Alice")
    assert (result.text, result.name) == ("fetch me a drink", None)


def test_reply_names_the_robot_that_was_called():
    assert strip_wake("Hey Bob, fetch me a drink", "Alice").name == "Bob"
    assert strip_wake("fetch me a drink", "Alice").name is None


def test_a_name_of_any_characters_is_taken_literally():
    assert strip_wake("Hey R2.D2, come here", "R2.D2").name
    assert strip_wake("Hey R2xD2, come here", "R2.D2").name != "R2.D2"


@pytest.mark.parametrize(
    "transcript",
    [
        "Hey Ellis, fetch me a drink.",
        "Hey, Alyss, fetch me a drink.",
        "Hey Alis fetch me a drink",
        "Hey Elise, fetch me a drink.",
        "Hay Alice fetch me a drink",
        "High Alyss, fetch me a drink.",
        "Okay, Ellis, fetch me a drink.",
        "He Alice, fetch me a drink.",
        "A Alice, fetch me a drink",
        "Hey Al is, fetch me a drink.",
        "Um, hey Ellis, fetch me a drink.",
        "Heyalice, fetch me a drink",
        "Alis, fetch me a drink.",
    ],
)
def test_a_misheard_name_still_wakes(transcript):
    address = find_heard_wake(transcript, "Alice")
    assert address.name == "Alice"
    assert address.text.removeprefix("Um, ").rstrip(".") == "fetch me a drink"


@pytest.mark.parametrize(
    "transcript",
    [
        "Hey Alex, fetch me a drink.",
        "Hey Alexa, fetch me a drink.",
        "Hey Alan, fetch me a drink.",
        "Hey Ellen, fetch me a drink.",
        "Hey Bob, fetch me a drink.",
        "Hey, fetch me a drink.",
        "Hey, Ellis is my friend.",
        "Ellis is my friend.",
        "Ellis, fetch me a drink.",
        "Hello there.",
        "Okay, let's go.",
        "I said hey Ellis.",
        "",
    ],
)
def test_another_name_does_not_wake(transcript):
    assert find_heard_wake(transcript, "Alice") == find_address(transcript, ())


def test_nothing_said_to_nobody_wakes_by_its_sound():
    taken = [text for text in NOBODY if find_heard_wake(text, "Alice", others=("Bob",)).name is not None]
    assert len(taken) * 100 <= FALSE_PER_100 * len(NOBODY), taken


def test_a_name_nearer_to_another_robot_is_not_for_this_one():
    assert find_heard_wake("Hey Ellis, stop", "Alice", others=("Elise",)).name is None
    assert find_heard_wake("Hey Ellis, stop", "Elise", others=("Alice",)).name == "Elise"
