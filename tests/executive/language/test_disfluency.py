import pytest

from executive.language.disfluency import repair_disfluencies
from executive.language.items import spoken_words
from executive.language.phrases import noun_phrases
from executive.language.reading import Reader


def hint(parser, text):
    tokens = parser.parse(text)
    return spoken_words(repair_disfluencies(Reader(tokens, noun_phrases(tokens)).read()))


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("bring the wrench , no , the hammer", "bring the hammer"),
        ("go to the hall , i mean to the kitchen", "go to the kitchen"),
        ("go to the hall , no , the kitchen", "go to the kitchen"),
        ("bring it to Sarah , no , to David", "bring it to David"),
        ("bring the cup , no wait , go to the hall", "go to the hall"),
        ("get the cup here , no , to the hall", "get the cup to the hall"),
        ("bring the cup , not the plate or the fork", "bring the cup"),
        ("do not bring the cup , bring the plate", "bring the plate"),
        ("do not go to the hall but to the kitchen", "go to the kitchen"),
        ("no , bring the cup", "bring the cup"),
        ("sorry , bring the cup", "bring the cup"),
    ],
)
def test_corrected_words_are_removed(parser, text, meant):
    assert hint(parser, text) == meant


@pytest.mark.parametrize("text", ["bring the cup not", "bring the cup , no", "is the cup not here"])
def test_correction_without_a_target_is_an_unknown_word(parser, text):
    assert {"not", "no"} & set(hint(parser, text).split())
