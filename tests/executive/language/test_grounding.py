"""Names as people say them in world.yaml: taken, asked or refused."""

import pytest

from executive.language.understand import Status, understand


@pytest.fixture
def understood(parser, knowledge):
    return lambda sentence: understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)


@pytest.mark.parametrize(
    ("sentence", "thing"),
    [
        ("fetch me a spanner", "wrench"),
        ("fetch me a soda", "coke"),
        ("fetch me a lager", "beer"),
        ("fetch me a beverage", "drink"),
        ("fetch me the adjustable wrench", "wrench"),
        ("fetch me a can of coke", "coke"),
        ("fetch me a bottle of beer", "beer"),
        ("fetch me the red spanner", "red wrench"),
        ("fetch me the wrnch", "wrench"),
        ("fetch me the big screwdrver", "big screwdriver"),
    ],
)
def test_object_is_found_by_a_synonym(understood, sentence, thing):
    answer = understood(sentence)
    assert answer.status is Status.OK, answer.reason
    assert str(answer.commands[0].object) == thing


@pytest.mark.parametrize(
    ("sentence", "place"),
    [
        ("go to the lounge", "living room"),
        ("go to the sitting room", "living room"),
        ("go to the corridor", "hall"),
        ("go to the lab", "workshop"),
        ("go to the kitchin", "kitchen"),
        ("go to the bedside table", "night stand"),
        ("go to the table in the kitchen", "kitchen table"),
        ("go to the table in the lounge", "coffee table"),
        ("go to the bedroom table", "night stand"),
        ("go to the workshop bench", "workbench"),
    ],
)
def test_a_place_by_another_name_is_known(understood, sentence, place):
    answer = understood(sentence)
    assert answer.status is Status.OK, answer.reason
    assert answer.commands[0].goal == place


@pytest.mark.parametrize(
    ("sentence", "notes"),
    [
        ("fetch me a soda", ("I take 'soda' to be coke",)),
        ("go to the kitchin", ("I take 'kitchin' to be kitchen",)),
        ("fetch me a coke", ()),
        ("fetch me the coke can", ()),
    ],
)
def test_note_says_which_name_was_taken_for_which(understood, sentence, notes):
    assert understood(sentence).notes == notes


@pytest.mark.parametrize(
    ("sentence", "slot", "candidates"),
    [
        ("put the cube on the table", "place", ["kitchen table", "coffee table"]),
        ("fetch me a cake", "thing", ["coke"]),
        ("fetch me the hamper", "thing", ["hammer"]),
        ("fetch me the toy hammer", "thing", ["hammer"]),
        ("bring the hammer to the man", "person", ["Robin", "Charlie"]),
        ("take it to the kitchen", "thing", []),
        ("go there", "place", []),
        ("send the hammer", "goal", []),
    ],
)
def test_ambiguous_or_doubtful_name_makes_a_question(understood, sentence, slot, candidates):
    answer = understood(sentence)
    assert (answer.status, answer.commands) == (Status.QUESTION, ())
    asked = answer.to_json()["question"]
    assert (asked["slot"], asked["candidates"]) == (slot, candidates)
    assert asked["text"].endswith("?")


@pytest.mark.parametrize("sentence", ["fetch me a drink", "fetch me a tool", "find a drink in the kitchen"])
def test_any_member_serves_for_a_category_and_nothing_is_asked(understood, sentence):
    assert understood(sentence).status is Status.OK


@pytest.mark.parametrize(
    "sentence", ["fetch me a banana", "go to the cellar", "bring the hammer to Quentin", "fetch me a unicorn"]
)
def test_unknown_name_is_refused_with_the_known_ones(understood, sentence):
    answer = understood(sentence)
    assert (answer.status, answer.question) == (Status.REFUSED, None)
    assert "known" in answer.reason
    assert "\n" not in answer.reason


def test_two_members_of_a_kind_are_asked_by_their_names(parser, knowledge):
    facts = {name: facts.model_copy(update={"aliases": ()}) for name, facts in knowledge.things.items()}
    both = knowledge.model_copy(update={"things": {**facts, "lemonade": facts["beer"]}})
    answer = understand("fetch me a soda", parser=parser, knowledge=both, require_wake=False)
    assert answer.reason == "Which soda: coke or lemonade?"


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("Bring mir bitte ein Bier aus der Küche", "German"),
        ("apporte-moi une bière s'il vous plaît", "French"),
        ("tráeme una cerveza de la cocina por favor", "Spanish"),
        ("принеси мне пиво", "English only"),
        ("把饮料拿来", "English only"),
        ("飲み物を持ってきて", "English only"),
    ],
)
def test_other_languages_are_answered_as_such(understood, sentence, words):
    answer = understood(sentence)
    assert answer.status is Status.REFUSED
    assert words in answer.reason


@pytest.mark.parametrize(
    ("sentence", "place"),
    [("where is Robin", "Nothing"), ("find Robin", "Nothing"), ("is Robin in the bedroom", "bedroom")],
)
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


@pytest.mark.parametrize(
    ("sentence", "task"),
    [
        ("clear the coffee table onto the workbench", "Nothing"),
        ("Alice, please clear the coffee table onto the bench", "Nothing"),
        ("move everything from the coffee table to the workbench", "Nothing"),
        ("take everything off the coffee table to the workbench", "Nothing"),
        ("move all the things from the coffee table to the workbench", "Nothing"),
        ("put everything on the coffee table onto the workbench", "place"),
    ],
)
def test_everything_on_a_surface_is_taken_to_another(understood, sentence, task):
    answer = understood(sentence)
    assert answer.status is Status.OK, answer.reason
    get, bring = map(str, answer.commands)
    assert get == "Take [Nothing] to [coffee table] and do [grasp] to [everything]"
    target = "everything" if task == "place" else "Nothing"
    assert bring == f"Take [everything] to [workbench] and do [{task}] to [{target}]"


def test_everything_needs_a_place_to_be_taken_from(understood):
    answer = understood("move all the things to the workbench")
    assert answer.status is not Status.OK
    assert "from where" in answer.reason
