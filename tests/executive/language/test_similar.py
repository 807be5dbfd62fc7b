import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.language.similar import correct_spelling, look_alikes, synonyms_of, words_for

KNOWN = {"wrench": "wrench", "coke": "coke", "lemonade": "lemonade", "living room": "living room", "hammer": "hammer"}


@pytest.mark.parametrize(
    ("word", "names"),
    [
        ("spanner", ("wrench",)),
        ("Spanner", ("wrench",)),
        ("lounge", ("living room",)),
        ("coca cola", ("coke",)),
        ("soda", ("coke", "lemonade")),
        ("unicorn", ()),
    ],
)
def test_a_synonym_stands_for_the_known_names(word, names):
    assert synonyms_of(word, KNOWN) == names


def test_a_name_has_its_synonyms_and_the_words_for_its_kind():
    assert {"spanner", "monkey wrench"} <= set(words_for("wrench"))
    assert {"cola", "soda", "soft drink"} <= set(words_for("coke"))
    assert words_for("unicorn") == ()


@pytest.mark.parametrize(
    ("text", "corrected"),
    [
        ("bring me the wrnch", "bring me the wrench"),
        ("fetch a screwdrver from the worshop", "fetch a screwdriver from the workshop"),
        ("go to the kitchin", "go to the kitchen"),
        ("go to the livng room", "go to the living room"),
        ("bring me two hammrs", "bring me two hammers"),
        ("bring the extingiusher to Robbin", "bring the extinguisher to Robin"),
        ("put it on the kitchn counter", "put it on the kitchen counter"),
        ("fetch me a spaner", "fetch me a spanner"),
    ],
)
def test_a_misspelled_name_is_corrected_and_told(parser, knowledge, text, corrected):
    answer = correct_spelling(text, knowledge, parser)
    assert answer.text == corrected
    assert answer.notes
    assert all(note.startswith("I take '") for note in answer.notes)


@pytest.mark.parametrize(
    ("text", "corrected"),
    [
        ("put it on the night-stand", "put it on the night stand"),
        ("go to the livingroom", "go to the living room"),
        ("fetch the screw driver", "fetch the screw driver"),
    ],
)
def test_names_written_together_or_apart_are_the_same_and_not_told(parser, knowledge, text, corrected):
    answer = correct_spelling(text, knowledge, parser)
    assert (answer.text, answer.notes) == (corrected, ())


@pytest.mark.parametrize(
    "text",
    [
        "bring me the cake",  # an English word, however near to coke
        "bring me the hamper",
        "go to the ranch",
        "bring me the bear",
        "bring me the xyzzyqq",  # near to nothing
        "bring me the hmr",  # too short to be sure
        "bring the tablet to the wall",
        "",
    ],
)
def test_what_may_be_right_is_left_alone(parser, knowledge, text):
    assert correct_spelling(text, knowledge, parser).text == text


@pytest.mark.parametrize(("word", "names"), [("cake", ("coke",)), ("ranch", ("wrench",)), ("unicorn", ())])
def test_what_looks_or_sounds_alike_may_be_meant(parser, word, names):
    assert look_alikes(word, KNOWN, parser) == names


@given(st.text(max_size=30))
def test_any_text_is_corrected_without_an_error(parser, knowledge, text):
    correct_spelling(text, knowledge, parser)
