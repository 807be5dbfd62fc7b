import pytest

from executive.language.clauses import Cue, cut, trailing_cue
from tests.tables import table


def cues(text):
    return [(one.kind, one.cue, one.text) for one in cut(text)]


def test_clauses_begin_with_verbs_and_with_words_that_decide():
    assert cues("go to the hall, and if there is a beer bring it, otherwise get a coke") == [
        (None, "", "go to the hall"),
        (Cue.IF, "if", "there is a beer bring it"),
        (Cue.OTHERWISE, "otherwise", "get a coke"),
    ]


@pytest.mark.parametrize(
    "text", ["go and charge", "bring a beer and a coke", "say please step aside", "wait until 14:30"]
)
def test_one_clause_is_not_split(text):
    assert [one.text for one in cut(text)] == [text]


@pytest.mark.parametrize(*table(__file__, "trailing_cues"))
def test_trailing_cue_is_found(text, before, kind, rest):
    found = trailing_cue(text)
    assert (found.before, found.kind.name, found.text) == (before, kind, rest)


@pytest.mark.parametrize(
    "text", ["check if there is a beer", "ask Robin if he wants a beer", "bring a beer", "tell me if it is there"]
)
def test_an_indirect_question_stands_behind_nothing(text):
    assert trailing_cue(text) is None
