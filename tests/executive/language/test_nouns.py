import pytest

from executive.language.nouns import NounKind, NounKinds


@pytest.fixture(scope="module")
def kinds(parser):
    return NounKinds.load(parser.vector)


def test_an_example_is_of_its_kind(kinds):
    assert kinds.kind(("hammer",), lemma="hammer") is NounKind.THING
    assert kinds.kind(("stories",), lemma="story") is NounKind.ABSTRACT


def test_a_pair_of_nouns_goes_before_its_last(kinds):
    assert kinds.kind(("station",), lemma="station") is NounKind.PLACE
    assert kinds.kind(("gas", "station"), lemma="station") is NounKind.ELSEWHERE


def test_a_noun_without_vector_is_of_no_kind(kinds):
    assert kinds.kind(("zzyxqv",), lemma="zzyxqv") is None
