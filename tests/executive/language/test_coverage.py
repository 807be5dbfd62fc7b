"""Each word of a sentence is a part of its meaning, or stands in a note or in the refusal."""

from functools import partial

import pytest

from executive.language.explain import Use, word_uses
from executive.language.understand import Status, understand
from tests.tables import table, yaml_beside


@pytest.fixture
def understood(parser, knowledge):
    return partial(understand, parser=parser, knowledge=knowledge, require_wake=False)


@pytest.fixture
def with_bin(knowledge):
    surfaces = knowledge.surfaces
    bins = {"night stand": surfaces["night stand"].model_copy(update={"bin": True})}
    return knowledge.model_copy(update={"surfaces": {**surfaces, **bins}})


def meaning_of(answer):
    values = answer.to_json()
    return answer.status, values["commands"], values["mission"]


@pytest.mark.parametrize(*table(__file__, "noted"))
def test_a_word_that_changes_nothing_stands_in_a_note(understood, sentence, without, quoted):
    longer, shorter = understood(sentence), understood(without)
    assert (longer.status, meaning_of(longer)) == (Status.OK, meaning_of(shorter))
    more = " ".join(note for note in longer.notes if note not in shorter.notes)
    assert [words for words in quoted if f"'{words}'" not in more] == []


@pytest.mark.parametrize(*table(__file__, "lost"))
def test_a_lost_word_refuses_the_sentence_and_is_named(understood, sentence, named):
    answer = understood(sentence)
    assert (answer.status, named in answer.reason) == (Status.REFUSED, True), answer.reason


@pytest.mark.parametrize("sentence", yaml_beside(__file__, "test_coverage.yaml")["silent"])
def test_fillers_and_words_of_the_meaning_make_no_note(understood, sentence):
    answer = understood(sentence)
    assert (answer.status, answer.notes) == (Status.OK, ())


@pytest.mark.parametrize(
    "sentence",
    [
        "throw away the beer on the kitchen table",
        "put the beer from the kitchen table in the bin",
        "put the beer from the kitchen table in the bin in the bedroom",
        "dump the beer",
        "dump the beer in the trash can",
    ],
)
def test_robot_throws_things_away_into_the_bin(understood, with_bin, sentence):
    answer = understood(sentence, knowledge=with_bin)
    taken, put = answer.commands
    assert (taken.goal, put.goal) == ("kitchen" if "dump" in sentence else "kitchen table", "night stand")


def test_a_bin_in_another_room_is_not_meant(understood, with_bin):
    assert "no bin" in understood("put the beer into the bin in the kitchen", knowledge=with_bin).reason


@pytest.mark.parametrize(
    ("sentence", "uses"),
    [
        ("please go to the kitchen slowly", {"please": Use.FILLER, "kitchen": Use.MEANING, "slowly": Use.NOTE}),
        ("bring me the coke via the hall", {"coke": Use.MEANING, "via": Use.REFUSED, "hall": Use.REFUSED}),
    ],
)
def test_explanation_says_where_each_word_went(understood, sentence, uses):
    found = dict(word_uses(understood(sentence).trace))
    assert [*found] == [*dict.fromkeys(sentence.split())]
    assert {word: found[word] for word in uses} == uses
