import pytest

from executive.language.cleaning import clean, find_address, find_heard_wake, strip_wake
from tests.tables import table, yaml_beside


@pytest.mark.parametrize(*table(__file__, "plain_text"))
def test_text_becomes_plain(text, cleaned):
    assert clean(text) == cleaned


TABLE = yaml_beside(__file__, "wake.yaml")
ROBOTS = ("Alice", "Bob")
NOBODY = TABLE["nobody"]
CALLING = [(name, text) for name in ROBOTS for text in TABLE[name]]
MISSED_PER_100, FALSE_PER_100 = 3, 1


def test_of_a_hundred_calls_three_are_missed_at_most():
    missed = [text for name, text in CALLING if find_address(text, ROBOTS).name != name]
    assert len(missed) * 100 <= MISSED_PER_100 * len(CALLING), missed


def test_of_a_hundred_sentences_for_nobody_one_is_taken_at_most_by_its_words_or_sound():
    assert len(NOBODY) >= 100
    by_words = [text for text in NOBODY if find_address(text, ROBOTS).name is not None]
    by_sound = [text for text in NOBODY if find_heard_wake(text, "Alice", others=("Bob",)).name is not None]
    for taken in (by_words, by_sound):
        assert len(taken) * 100 <= FALSE_PER_100 * len(NOBODY), taken


def test_of_several_robots_at_most_one_takes_a_sentence():
    others = {"Alice": ("Bob",), "Bob": ("Alice",)}
    for _, text in CALLING:
        takers = [name for name in ROBOTS if find_heard_wake(text, name, others=others[name]).name == name]
        assert len(takers) <= 1, text


@pytest.mark.parametrize(*table(__file__, "wake_phrases"))
def test_the_wake_phrase_is_taken_out_where_it_stands(text, called, rest, name):
    result = strip_wake(text, called)
    assert (result.text, result.name) == (rest, name)


@pytest.mark.parametrize(*table(__file__, "for_others"))
def test_other_sentences_are_not_for_this_robot(text):
    result = strip_wake(text, "Alice")
    assert result.text == text and result.name != "Alice"


@pytest.mark.parametrize(*table(__file__, "misheard_names"))
def test_a_misheard_name_still_wakes(transcript):
    address = find_heard_wake(transcript, "Alice")
    assert (address.name, address.text.removeprefix("Um, ").rstrip(".")) == ("Alice", "fetch me a drink")


@pytest.mark.parametrize(*table(__file__, "other_names"))
def test_another_name_does_not_wake(transcript):
    assert find_heard_wake(transcript, "Alice") == find_address(transcript, ())


def test_a_name_nearer_to_another_robot_is_not_for_this_one():
    assert find_heard_wake("Hey Ellis, stop", "Alice", others=("Elise",)).name is None
    assert find_heard_wake("Hey Ellis, stop", "Elise", others=("Alice",)).name == "Elise"
