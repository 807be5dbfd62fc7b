"""Sentences that decide, repeat, wait and go on: their missions, and the refusals of near misses."""

from functools import partial
from itertools import product

import pytest

from executive.language.structure.sentence import MOST_NESTED
from executive.language.understand import Status, ask_until_clear, understand
from executive.words.condition import DoorOpen
from executive.words.steps import steps_from_yaml, steps_to_yaml
from tests.executive.language.notation import as_noted, noted
from tests.tables import table, yaml_beside


def rows(file, kind=None):
    tables = yaml_beside(__file__, file)
    found = (
        (world, text, expected)
        for world, table in tables.items()
        for text, expected in (table[kind] if kind else table).items()
    )
    return [pytest.param(*row, id=f"{row[0]}: {row[1]}") for row in found]


UNDERSTOOD = [*rows("sentences.yaml", "understood"), *rows("limits.yaml", "understood")]


@pytest.mark.parametrize(("world", "sentence", "lines"), UNDERSTOOD)
def test_a_sentence_becomes_its_mission_whose_yaml_reads_back(meant, world, sentence, lines):
    answer = meant(sentence, world)
    assert (answer.reason, noted(answer.all_steps)) == (None, as_noted(lines))
    assert steps_from_yaml(steps_to_yaml(answer.all_steps)) == answer.all_steps


@pytest.mark.parametrize(("world", "sentence", "part"), rows("refused.yaml"))
def test_a_near_miss_is_refused_with_its_words(meant, world, sentence, part):
    answer = meant(sentence, world)
    assert (answer.status, answer.commands, answer.steps) == (Status.REFUSED, (), ())
    assert part.lower() in answer.reason.lower()


@pytest.mark.parametrize(*table(__file__, "notes"))
def test_a_note_says_which_place_is_meant(meant, sentence, notes):
    assert meant(sentence).notes == tuple(notes)


def test_a_door_with_a_plug_in_is_opened_and_no_other(parser, worlds):
    opens = {"opens": {"plugin": "http"}}
    doors = tuple(door.model_copy(update=opens if "office" in door.between else {}) for door in worlds["shop"].doors)
    knowledge = worlds["shop"].model_copy(update={"doors": doors})
    understood = partial(understand, parser=parser, knowledge=knowledge, require_wake=False)
    assert noted(understood("please open the office door for me").steps) == 'Open "office" - "side aisle"'
    assert "cannot open the bathroom door myself" in understood("open the bathroom door").reason


def test_a_sentence_of_too_many_words_is_not_read_for_people(meant):
    assert "too many for one sentence" in meant("follow me, " * 40).reason


def test_all_commands_stand_in_their_order(meant):
    answer = meant("if there is a beer in the kitchen bring it, otherwise go to the hall")
    assert [command.goal for command in answer.commands] == ["kitchen", "start", "hall"]


@pytest.mark.parametrize(
    "sentence",
    ["see if there is a beer in the kitchen", "first get a beer, then go to the hall, and finally come back"],
)
def test_plain_commands_have_no_steps(meant, sentence):
    answer = meant(sentence)
    assert answer.commands and answer.steps == ()


def test_a_door_that_could_be_several_is_asked_about(meant):
    answer = meant("every ten minutes look whether the kitchen door is open", "shop")
    doors = tuple(f"door between kitchen and {room}" for room in ("back aisle", "staff room"))
    assert (answer.status, answer.question.candidates) == (Status.QUESTION, doors)


def test_it_needs_no_punctuation_where_that_is_clear(meant):
    with_commas = meant("If there is a beer in the kitchen, bring it, otherwise get a coke.")
    assert meant("if there is a beer in the kitchen bring it otherwise get a coke").steps == with_commas.steps


@pytest.mark.parametrize(
    ("reply", "room"), [("the second one", "staff room"), ("back aisle", "back aisle"), ("staff room", "staff room")]
)
def test_the_answer_tells_which_door(parser, worlds, reply, room):
    asked = partial(understand, parser=parser, knowledge=worlds["shop"], require_wake=False)
    answer = ask_until_clear("if the kitchen door is open, come back", asked, lambda question: reply)
    assert answer.steps[0].condition == DoorOpen(door=("kitchen", room))


@pytest.mark.parametrize("often", ["", "every ten minutes "])
def test_a_world_without_doors_has_none_to_look_at(parser, worlds, often):
    knowledge, sentence = worlds["flat"].model_copy(update={"doors": ()}), f"{often}look whether the door is open"
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert (answer.status, answer.steps) == (Status.REFUSED, ()) and "no door here" in answer.reason


def test_there_needs_an_earlier_place(meant):
    answer = meant("if Robin is there bring him a beer")
    assert (answer.status, "there" in answer.reason) == (Status.QUESTION, True), answer.reason


def test_a_time_that_could_be_two_is_noted(meant):
    assert meant("wait until half past two").notes == ("I take 'half past two' as 14:30",)
    assert meant("wait until 14:30").notes == ()


def test_blocks_nest_no_deeper_than_two(meant):
    answer = meant("twice, three times, twice, say hello")
    assert (MOST_NESTED, answer.status, "two sentences" in answer.reason) == (2, Status.REFUSED, True), answer.reason


def test_memory_has_the_last_object(meant):
    memory = meant("if there is a beer in the kitchen bring it to Robin").memory
    assert str(meant("bring it to the office", memory=memory).commands[-1]).startswith("Take [beer]")


def test_names_alone_keep_conditions_refused(parser):
    text = "if there is milk, bring me a glass"
    assert understand(text, parser=parser, knowledge=None, require_wake=False).status is Status.REFUSED


TOLD = (
    *("tell me", "let me know", "find out", "go and find out for me", "check", "see", "have a look and tell me"),
    *("I would like to know", "do you know", "report to me", "could you figure out", "I am curious"),
)
QUESTIONS = {
    "how many beers are in the kitchen": (
        "how many beers there are in the kitchen",
        "the number of beers in the kitchen",
    ),
    "where is the hammer": ("where the hammer is", "in which room the hammer is", "which room the hammer is in"),
    "is there a hammer in the workshop": ("whether there is a hammer in the workshop",),
    "is the office door open": ("if the office door is open",),
    "what is on the workbench": ("what there is on the workbench", "what you can see on the workbench"),
    "is anybody in the kitchen": ("whether anybody is in the kitchen", "who is in the kitchen"),
}


@pytest.mark.parametrize(("bare", "questions"), QUESTIONS.items())
def test_a_question_that_somebody_asks_for_means_the_bare_question(meant, bare, questions):
    expected = noted(meant(bare, "flat").all_steps)
    assert expected
    for told, question in product(TOLD, questions):
        assert noted(meant(f"{told} {question}", "flat").all_steps) == expected, told
