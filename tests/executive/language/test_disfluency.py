import pytest

from executive.language.disfluency import repair_disfluencies
from executive.language.items import spoken_words
from executive.language.phrases import noun_phrases
from executive.language.reading import Reader
from tests.tables import table


def hint(parser, text):
    tokens = parser.parse(text)
    return spoken_words(repair_disfluencies(Reader(tokens, noun_phrases(tokens)).read()))


@pytest.mark.parametrize(*table(__file__, "corrected_words"))
def test_corrected_words_are_removed(parser, text, meant):
    assert hint(parser, text) == meant


@pytest.mark.parametrize("text", ["bring the cup not", "bring the cup , no", "is the cup not here"])
def test_correction_without_a_target_is_an_unknown_word(parser, text):
    assert {"not", "no"} & set(hint(parser, text).split())
