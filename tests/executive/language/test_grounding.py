"""Names as people say them in world.yaml: taken, asked or refused."""

import pytest

from executive.language.understand import Status, understand
from executive.words.command import START
from executive.words.task import task_named
from tests.tables import table


@pytest.fixture
def understood(parser, knowledge):
    return lambda sentence: understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)


@pytest.mark.parametrize(*table(__file__, "objects"))
def test_object_is_found_by_a_synonym(understood, sentence, thing):
    answer = understood(sentence)
    assert (answer.reason, answer.status, str(answer.commands[0].object)) == (None, Status.OK, thing)


@pytest.mark.parametrize(*table(__file__, "places"))
def test_a_place_by_another_name_is_known(understood, sentence, place):
    answer = understood(sentence)
    assert (answer.reason, answer.status, answer.commands[0].goal) == (None, Status.OK, place)


@pytest.mark.parametrize(*table(__file__, "notes"))
def test_note_says_which_name_was_taken_for_which(understood, sentence, notes):
    assert understood(sentence).notes == tuple(notes)


@pytest.mark.parametrize(*table(__file__, "questions"))
def test_ambiguous_or_doubtful_name_makes_a_question(understood, sentence, slot, candidates):
    answer = understood(sentence)
    asked = answer.to_json()["question"]
    assert (answer.status, answer.commands) == (Status.QUESTION, ())
    assert (asked["slot"], asked["candidates"], asked["text"][-1]) == (slot, candidates, "?")


@pytest.mark.parametrize("sentence", ["fetch me a drink", "fetch me a tool", "find a drink in the kitchen"])
def test_any_member_serves_for_a_category_and_nothing_is_asked(understood, sentence):
    assert understood(sentence).status is Status.OK


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("go to the workbench in the kitchen", "the workbench is not in the kitchen, but in the workshop"),
        ("put the beer on the workbench in the lounge", "the workbench is not in the living room, but in the workshop"),
        ("go to the workbench on the kitchen table", "the workbench is not on the kitchen table, but in the workshop"),
        ("go to the kitchen in the bedroom", "the kitchen is not in the bedroom"),
    ],
)
def test_a_known_place_said_to_be_elsewhere_is_refused_by_where_it_is(understood, sentence, reason):
    answer = understood(sentence)
    assert (answer.status, answer.question, answer.reason) == (Status.REFUSED, None, reason)


@pytest.mark.parametrize(
    "sentence", ["fetch me a banana", "go to the cellar", "bring the hammer to Quentin", "fetch me a unicorn"]
)
def test_unknown_name_is_refused_with_the_known_ones(understood, sentence):
    answer = understood(sentence)
    assert (answer.status, answer.question) == (Status.REFUSED, None)
    assert "known" in answer.reason and "\n" not in answer.reason


def test_two_members_of_a_kind_are_asked_by_their_names(parser, knowledge):
    facts = {name: facts.model_copy(update={"aliases": ()}) for name, facts in knowledge.things.items()}
    both = knowledge.model_copy(update={"things": {**facts, "lemonade": facts["beer"]}})
    answer = understand("fetch me a soda", parser=parser, knowledge=both, require_wake=False)
    assert answer.reason == "Which soda: coke or lemonade?"


@pytest.mark.parametrize(*table(__file__, "other_languages"))
def test_other_languages_are_answered_as_such(understood, sentence, words):
    answer = understood(sentence)
    assert (answer.status, words in answer.reason) == (Status.REFUSED, True), answer.reason


@pytest.mark.parametrize(*table(__file__, "only_person"))
def test_the_only_person_of_a_world_is_looked_for(parser, knowledge, sentence, place):
    alone = knowledge.model_copy(update={"people": {"Robin": knowledge.people["Robin"]}})
    answer = understand(sentence, parser=parser, knowledge=alone, require_wake=False)
    assert [str(command) for command in answer.commands] == [f"Take [Nothing] to [{place}] and do [find] to [Robin]"]


def test_object_asked_for_in_a_room_without_surfaces_is_brought_there(understood):
    answer = understood("I need the hammer in the hall")
    assert [str(command) for command in answer.commands] == [
        "Take [Nothing] to [workshop] and do [grasp] to [hammer]",
        "Take [hammer] to [hall] and do [Nothing] to [Nothing]",
    ]
    assert answer.notes == ("I bring it to the hall: nothing can be taken from there",)


@pytest.mark.parametrize("sentence", ["bring me the hammer from the hall", "I need the hammer in the kitchen"])
def test_object_from_a_room_is_looked_for_there(understood, sentence):
    assert str(understood(sentence).commands[1].goal) == "start"


@pytest.mark.parametrize(*table(__file__, "everything"))
def test_everything_on_a_surface_is_taken_to_another(understood, sentence, task):
    answer = understood(sentence)
    assert (answer.status, [str(command) for command in answer.commands]) == (Status.OK, [
        "Take [Nothing] to [coffee table] and do [grasp] to [everything]",
        f"Take [everything] to [workbench] and do [{task}] to [{'everything' if task == 'place' else 'Nothing'}]",
    ]), answer.reason  # fmt: skip


def test_everything_needs_a_place_to_be_taken_from(understood):
    answer = understood("move all the things to the workbench")
    assert answer.status is not Status.OK and "from where" in answer.reason


@pytest.mark.parametrize("sentence", ["go home", "please drive home", "go back home", "return home"])
def test_home_is_the_dock_and_a_note_says_so(understood, sentence):
    answer = understood(sentence)
    assert [command.task for command in answer.commands] == [task_named("charge")]
    assert answer.notes == ("I take 'home' to be the dock",)


def test_home_without_a_dock_is_where_the_robot_was_spoken_to(parser, knowledge):
    bare = knowledge.model_copy(update={"dock": None})
    answer = understand("go home", parser=parser, knowledge=bare, require_wake=False)
    assert [command.goal for command in answer.commands] == [START]


@pytest.mark.parametrize("sentence", ["count the coke cans in the kitchen", "count the cans of coke in the kitchen"])
def test_the_plural_of_a_name_of_two_nouns_is_known(parser, knowledge, sentence):
    coke = knowledge.things["coke"].model_copy(update={"aliases": ("coke can", "can of coke")})
    named = knowledge.model_copy(update={"things": {**knowledge.things, "coke": coke}})
    answer = understand(sentence, parser=parser, knowledge=named, require_wake=False)
    assert [(str(command.object), command.object_count) for command in answer.commands] == [("coke", 0)]
