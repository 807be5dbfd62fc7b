"""Sentences of tasks of other distributions take part in all that sentences can do."""

import re

import pytest

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.language.followups import Remark, parse_recall, parse_remark
from executive.language.questions import abilities
from executive.language.several_robots import understand_for_robots
from executive.language.structure import sentence
from executive.language.task_sentences import (
    other_readings,
    sentence_faults,
    spoken_tasks,
    task_forms,
    task_openers,
    verb_forms,
)
from executive.language.understand import Status, understand
from executive.words import task
from executive.words.steps import steps_from_yaml, steps_to_yaml
from executive.words.task import Part
from skills.inputs.yaml_source import yaml_of
from tests.executive.distribution import module_of_a_plug_in
from tests.executive.house_tasks import Call, Cheer, Sweep, Vacuum, Water, tasks_installed
from tests.missions.own_tasks.read_number import ReadNumber
from tests.missions.own_tasks.water import Water as WaterObject
from tests.tables import yaml_beside


@pytest.fixture(scope="module")
def flat():
    """What is known of the shipped world `flat`."""
    return knowledge_of(open_world("flat"))


def written(said, parser, knowledge):
    """Steps that a sentence means, as YAML lines; or the reason why it is refused."""
    found = understand(said, parser=parser, knowledge=knowledge, require_wake=False)
    return " | ".join(each.strip() for each in steps_to_yaml(found.all_steps)) or found.reason


#   said, meant
SAID = {
    "vacuum the kitchen": "- {to: kitchen, do: vacuum}",
    "please hoover the floor of the living room": "- {to: living room, do: vacuum}",
    "could you vacuum the kitchen": "- {to: kitchen, do: vacuum}",
    "vacuum the kitchen and the living room": "- {to: kitchen, do: vacuum} | - {to: living room, do: vacuum}",
    "go to the kitchen and then vacuum it": "- {to: kitchen} | - {to: kitchen, do: vacuum}",
    "vacuum the kitchen twice": "- repeat: {times: 2} | steps: | - {to: kitchen, do: vacuum}",
    "vacuum the kitchen every ten minutes": "- repeat: {every: 600} | steps: | - {to: kitchen, do: vacuum}",
    "call out dinner is ready": "- {do: call, object: dinner is ready}",
}


@pytest.mark.parametrize(("sentence", "meant"), SAID.items())
def test_a_sentence_of_a_task_means_its_command(house_tasks, parser, knowledge, sentence, meant):
    assert written(sentence, parser, knowledge) == meant


def test_a_place_that_is_not_said_is_asked_for(house_tasks, parser, knowledge):
    assert "vacuum: where?" in written("vacuum", parser, knowledge)


def test_words_that_the_template_lacks_are_refused(house_tasks, parser, knowledge):
    assert "with" in written("vacuum the kitchen with Robin", parser, knowledge)


def test_a_clause_begins_with_the_word_of_a_task(house_tasks):
    assert task_openers() >= {"vacuum", "hoover", "water", "call", "read"}


def test_the_tasks_of_this_project_open_no_requests(no_people):
    assert task_openers() == frozenset()


class Mop(Vacuum):
    """Mops a room, and cleans it."""

    word, sentences, verbs = "mop", (), ("mop", "clean", "usher", "show")


class Polish(Vacuum):
    """Polishes the floor of a room once."""

    word = "polish"
    sentences = ({"template": "polish {place:goal}", "samples": ["polish the hall"]},)
    unkept = ({"said": r"polish [^,.;]*? with \w+", "reason": "I polish with water, and not as in '{}'"},)


def test_a_task_says_why_it_does_not_keep_words(house_tasks, parser, knowledge):
    house_tasks["polish"] = Polish()
    why = "I polish with water, and not as in 'polish the kitchen with wax'"
    assert why in written("polish the kitchen with wax", parser, knowledge)


WATER_BOTH = "- {to: hall, do: water, object: beer} | - {to: kitchen, do: water, object: beer}"


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("go to the hall but don't vacuum", "- {to: hall}"),
        ("would you mind vacuuming the hall", "- {to: hall, do: vacuum}"),
        ("before vacuuming the hall, go to the kitchen", "- {to: kitchen} | - {to: hall, do: vacuum}"),
        ("vacuum the hall at 3 pm", "- wait: {until_clock: '15:00'} | - {to: hall, do: vacuum}"),
        ("go to the hall and call out hello", "- {to: hall} | - {do: call, object: hello}"),
        ("come back and call out hello", "- {to: start} | - {do: call, object: hello}"),
        ("water the beer in each of the hall and the kitchen", WATER_BOTH),
        ("water the beer in the hall and in the kitchen", WATER_BOTH),
    ],
)
def test_requests_for_tasks_of_others_are_reworded_as_those_of_this_project(
    house_tasks, parser, knowledge, said, meant
):
    assert written(said, parser, knowledge) == meant


def test_each_robot_is_told_its_task_in_the_third_person(house_tasks, parser, knowledge):
    said = "Alice vacuums the hall and Bob waters the beer"
    parts = understand_for_robots(said, robots=("Alice", "Bob"), parser=parser, knowledge=knowledge).parts
    tasks = [(part.robot, str(command.task)) for part in parts for command in part.meaning.commands]
    assert tasks == [("Alice", "<task vacuum>"), ("Bob", "<task water>")]


@pytest.mark.parametrize("said", ["stop vacuuming", "you can stop following me now", "no need to follow me any more"])
def test_a_task_is_stopped_by_its_verb(house_tasks, said):
    assert parse_remark(said) is Remark.STOP


def test_the_verb_of_no_installed_task_stops_nothing(no_people):
    assert parse_remark("stop following me") is None


def test_a_task_is_done_in_every_room(house_tasks, parser, knowledge):
    rooms = [f"- {{to: {room}}} | - {{to: {room}, do: vacuum}}" for room in knowledge.rooms]
    assert written("go to every room and vacuum it", parser, knowledge) == " | ".join(rooms)


def test_verbs_of_tasks_open_requests_and_have_forms(house_tasks):
    house_tasks["mop"] = Mop()
    assert {"mop", "clean"} <= task_openers()
    forms = {"mopping": "mop", "mopped": "mop", "cleaned": "clean", "ushering": "usher", "showed": "show"}
    assert forms.items() <= task_forms().items()


def test_no_sentence_of_the_toys_is_that_of_another_task(house_tasks):
    assert [line for word in house_tasks for line in other_readings(word)] == []


class Clean(Vacuum):
    """Cleans otherwise."""

    word = "clean"
    sentences = ({"template": "(vacuum|clean) {place:goal}", "samples": ["clean the hall"]},)


class Rinse(Vacuum):
    """Rinses a floor in one of its ways."""

    word, rules = "rinse", {"how": "(wetly|drily)"}
    sentences = ({"template": "rinse [<how>] [{room:goal}]", "samples": ["rinse wetly the hall"]},)


class Scrub(Rinse):
    """Scrubs a floor in other ways."""

    word, rules = "scrub", {"how": "(hard|softly)"}
    sentences = ({"template": "scrub [<how>] [{room:goal}]", "samples": ["scrub hard the hall"]},)


def test_each_page_has_rules_of_its_own(house_tasks, parser, knowledge):
    house_tasks |= {"rinse": Rinse(), "scrub": Scrub()}
    assert "do: rinse" in written("rinse wetly the hall", parser, knowledge)
    assert "do: scrub" in written("scrub hard the hall", parser, knowledge)
    assert "do: rinse" not in written("rinse hard the hall", parser, knowledge)


def test_a_sentence_of_two_tasks_is_refused_and_found(house_tasks, parser, knowledge):
    house_tasks["clean"] = Clean()
    (line,) = other_readings("clean")
    assert re.fullmatch("'vacuum the hall' of task 'vacuum' of .* is also a sentence of task 'clean' of .*", line)
    assert "task 'vacuum' of an unknown distribution or task 'clean' of" in written("vacuum it", parser, knowledge)


@pytest.fixture
def no_people(monkeypatch):
    """Leaves the tasks of people out, as where the plug-in errand-people is not installed."""
    shipped = [each for each in task.installed_tasks().values() if not each.__module__.startswith("errand_")]
    monkeypatch.setattr(sentence, "_own_acts", tuple)
    with tasks_installed(*shipped, beside=False):
        yield


@pytest.mark.parametrize(
    "said",
    [
        "follow me",
        "guide Robin to the kitchen",
        "take me to the kitchen",
        "meet Robin",
        "greet Robin",
        "introduce yourself",
        "ask Robin if he wants a beer",
        "ask Robin what he wants to drink",
    ],
)
def test_a_request_about_people_names_the_plug_in_that_is_not_installed(no_people, parser, knowledge, said):
    assert f"'{said}' needs the plug-in errand-people, which is not installed" in written(said, parser, knowledge)


def test_without_the_plug_in_people_are_still_told_things(no_people, parser, knowledge):
    assert written("ask Robin to come", parser, knowledge) == "- {to: Robin} | - {speak: please come}"


def test_abilities_are_those_of_installed_tasks(no_people):
    assert abilities() == "I can fetch, take, put and find objects, go to places, wait and charge"


def test_abilities_name_the_tasks_with_sentences(house_tasks):
    named = "go to places, follow and guide people, vacuum, water, call, read, wait and charge"
    assert abilities() == f"I can fetch, take, put and find objects, {named}"


ACTS = """
from executive.words.leaf_steps import Speak

def sings(row, clause):
    if clause.text != "sing a song":
        return False
    row.put((Speak(speak="la la la"),), row.state)
    return True
"""


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Registers functions of a module that read clauses."""
    with module_of_a_plug_in(tmp_path, monkeypatch, "singers", "errand.sentences", ACTS) as registered:
        sentence._own_acts.cache_clear()
        yield registered
    monkeypatch.undo()
    sentence._own_acts.cache_clear()


def test_a_plug_in_reads_a_clause_by_itself(register, parser, knowledge):
    register("sings = singers:sings")
    assert written("sing a song and go to the hall", parser, knowledge) == "- {speak: la la la} | - {to: hall}"


def test_a_plug_in_whose_function_cannot_be_loaded_harms_no_other_sentence(register, parser, knowledge):
    register("sings = singers:shouts")
    assert "sing a song" in written("sing a song", parser, knowledge)
    assert written("follow Robin", parser, knowledge) == "- {do: follow, object: Robin}"


SIXTY = yaml_beside(__file__, "task_sentences.yaml")


def understood_or_refused(said, meant, parser, knowledge):
    """Compares what a sentence means with steps, or with a part of the reason why it is refused."""
    found = understand(said, parser=parser, knowledge=knowledge, require_wake=False)
    if isinstance(meant, str):
        assert found.status is not Status.OK
        assert meant in found.reason
    else:
        expected = steps_from_yaml(yaml_of(meant).splitlines())
        assert (found.reason, steps_to_yaml(found.all_steps)) == (None, steps_to_yaml(expected))


@pytest.mark.parametrize(("said", "meant"), SIXTY["understood"].items())
def test_a_sentence_with_tasks_of_others_is_understood_or_refused(house_tasks, parser, flat, said, meant):
    understood_or_refused(said, meant, parser, flat)


@pytest.mark.parametrize("said", SIXTY["refused"])
def test_a_sentence_with_tasks_that_is_not_understood_is_refused(house_tasks, parser, flat, said):
    assert understand(said, parser=parser, knowledge=flat, require_wake=False).status is not Status.OK


LATER, LAST = (yaml_beside(__file__, f"task_sentences_{when}.yaml") for when in ("later", "last"))


@pytest.mark.parametrize(("said", "meant"), [*LATER["understood"].items(), *LAST["understood"].items()])
def test_a_later_sentence_with_tasks_is_understood_or_refused(more_tasks, parser, flat, said, meant):
    understood_or_refused(said, meant, parser, flat)


@pytest.mark.parametrize("said", LATER["refused"])
def test_a_later_sentence_with_tasks_that_is_not_understood_is_refused(more_tasks, parser, flat, said):
    assert understand(said, parser=parser, knowledge=flat, require_wake=False).status is not Status.OK


@pytest.mark.parametrize("said", LATER["taken"])
def test_a_plain_sentence_of_errand_keeps_its_meaning_and_the_task_is_named(more_tasks, parser, flat, said):
    assert "patrol" not in written(said, parser, flat)
    assert "a sentence of Errand itself, is also one of task 'patrol'" in " ".join(other_readings("patrol"))


@pytest.mark.parametrize(("said", "parts"), [*LATER["robots"].items(), *LAST["robots"].items()])
def test_a_sentence_has_tasks_for_several_robots(more_tasks, parser, flat, said, parts):
    found = understand_for_robots(said, robots=("Alice", "Bob"), parser=parser, knowledge=flat)
    assert {str(part.robot): steps_to_yaml(part.meaning.all_steps) for part in found.parts} == {
        robot: steps_to_yaml(steps_from_yaml(yaml_of(steps).splitlines())) for robot, steps in parts.items()
    }


@pytest.mark.parametrize("row", LATER["answered"], ids=lambda row: row["asked"])
def test_a_question_is_about_the_request_that_was_done(more_tasks, parser, flat, row):
    done, asked = (written(said, parser, flat) for said in (row["done"], parse_recall(row["asked"])))
    assert (done == asked) is (row["answer"] == "yes")


#   said, meant, or a part of the refusal
MORE = {
    "vacuum the hall at noon and then the kitchen": (
        "- wait: {until_clock: '12:00'} | - {to: hall, do: vacuum} | - {to: kitchen, do: vacuum}"
    ),
    "water the beer, then the coke": "do: water, object: beer} | - {to: kitchen, do: water, object: coke}",
    "read every hour the number of the desk": "- repeat: {every: 3600} | steps: | - {to: desk, do: read}",
    "vacuum twice in the hall": "- repeat: {times: 2} | steps: | - {to: hall, do: vacuum}",
    "read the number of the desk and tell it to me": "- {to: desk, do: read}",
    "read the number of the desk and tell me the number": "- {to: desk, do: read}",
    "when you have read the number of the desk, tell me": "- {to: desk, do: read}",
    "read the number of the desk and tell me the weather": "tell me the weather",
    "vacuum the hall and tell me": "what am I to say",
    "vacuum the hall and then the kitchen twice": "it is not clear which action 'twice' belongs to",
    "water -1 beers": "'-1' is no number of objects",
    "take the beer to the desk and the coke to the sideboard and water them": "which objects are 'them'? Name each",
    "find the beer and the coke and water them": "do: water, object: beer} | - {to: kitchen, do: water, object: coke}",
    "call out that lunch is at 5 pm": "at 5 pm",
    "go and vacuum the hall": "- {to: hall, do: vacuum}",
    "vacuum every room but the kitchen and the hall": " | ".join(
        f"- {{to: {room}, do: vacuum}}" for room in ("living room", "bedroom", "bathroom", "workshop", "office")
    ),
    "vacuum every room except the dragon": "except",
    "vacuum the kitchen, no, the hall": "'no'",
}


@pytest.mark.parametrize(("said", "meant"), MORE.items())
def test_tasks_take_part_in_sequences_rounds_answers_and_counts(house_tasks, parser, flat, said, meant):
    assert meant in written(said, parser, flat)


#   said behind "take the beer to the desk", and where the beer is then
@pytest.mark.parametrize(
    ("said", "where"),
    [
        ("and water it", "desk"),
        ("and water the beer", "desk"),
        ("and if nobody is in the office, water it", "desk"),
        ("and water a beer", "kitchen"),
        ("and water the beer in the kitchen", "kitchen"),
    ],
)
def test_a_carried_object_is_where_it_was_put(house_tasks, parser, flat, said, where):
    whole = written(f"take the beer to the desk {said}", parser, flat)
    assert whole.endswith(f"- {{to: {where}, do: water, object: beer}}")


@pytest.mark.parametrize(("said", "who"), [("bring me the beer", "you have"), ("take the beer to Robin", "Robin has")])
def test_a_person_who_was_given_an_object_has_it(house_tasks, parser, flat, said, who):
    assert f"'water it': {who} it then; say where it is" in written(f"{said} and water it", parser, flat)


def test_a_verb_has_regular_past_forms_and_a_page_irregular_ones(house_tasks):
    forms = {"watered": "water", "watering": "water", "hoovered": "hoover", "read": "read"}
    assert {form: task_forms()[form] for form in forms} == forms


@pytest.mark.parametrize(
    ("verb", "forms"), [("mop", "mopped mopping"), ("dry", "dried drying"), ("wipe", "wiped wiping")]
)
def test_forms_of_verbs(verb, forms):
    assert {*forms.split()} <= verb_forms([verb]).keys()


# a template, its sample, and what is wrong with it
@pytest.mark.parametrize(
    ("template", "sample", "fault"),
    [
        ("mop [{place:goal}]", "mop the hall", None),
        ("mop [{goal}]", "mop the hall", None),
        ("mop <foo> {place:goal}", "mop the hall", "there is no rule 'foo'"),
        ("mop <circle> {place:goal}", "mop a hall", "its rules refer to each other in a circle"),
        ("mop [{place:goal}", "mop the hall", "a bracket is not closed"),
        ("mop {place:where}", "mop the hall", "the task has no part 'where' for a slot"),
        ("mop {thing:object}", "mop the cube", "the task has no part 'object' for a slot"),
        ("mop {banana:goal}", "mop the hall", "there is no list 'banana'"),
        ("mop {person:goal}", "mop Robin", "'{person:goal}' fills a part that is a place"),
        ("{place:goal}", "the hall", "it begins with no certain words"),
        ("mop {place:goal}", "fly away", "the sample 'fly away' does not match it"),
    ],
)
def test_a_template_that_cannot_be_read_is_named_and_takes_part_in_no_sentence(
    house_tasks, parser, knowledge, template, sample, fault
):
    mop = type("Mop", (Vacuum,), {"word": "mop", "rules": {"circle": "a <circle>"}})
    mop.sentences = ({"template": template, "samples": [sample]},)
    house_tasks["mop"] = mop()
    assert [*sentence_faults(mop())] == ([] if fault is None else [f"the template '{template}': {fault}"])
    assert (mop() in spoken_tasks()) is (fault is None)
    assert written("vacuum the kitchen", parser, knowledge) == "- {to: kitchen, do: vacuum}"


class Give(Vacuum):
    """Gives an object."""

    word, object_is, goal_is, needs_goal = "give", Part.THING, Part.NOTHING, False
    sentences = ({"template": "(bring|fetch) me {thing:object}", "samples": ["bring me a beer"]},)


class Announce(Call):
    """Announces a text."""

    word, sentences = "announce", ({"template": "announce {text:object}", "samples": ["announce dinner"]},)


class Spell(Call):
    """Spells a text."""

    word, sentences = "spell", ({"template": "spell [:] {text:object}", "samples": ["spell hello"]},)
    unkept = ({"said": r"(?<=spell )[\w, ]+ backwards", "reason": "I spell forwards, and not as in '{}'"},)


class Inspect(Vacuum):
    """Inspects a place."""

    word, object_is, goal_is, needs_goal = "inspect", Part.PLACE, Part.NOTHING, False
    sentences = ({"template": "inspect [{place:object}]", "samples": ["inspect the hall"]},)


class Wave(Vacuum):
    """Waves at a person."""

    word, goal_is = "wave", Part.PERSON
    sentences = ({"template": "wave at {person:goal}", "samples": ["wave at Robin"]},)


class PolishWet(Water):
    """Polishes an object with water."""

    word, unkept = "polish", Polish.unkept
    sentences = ({"template": "polish {thing:object} [with (wax|water)]", "samples": ["polish the hammer"]},)


class SweepRoom(Sweep):
    """Sweeps the floor of a room."""

    goal_is = Part.ROOM


PAGES = (Give(), Announce(), Spell(), Inspect(), Wave(), PolishWet(), SweepRoom(), Cheer())
OWN = yaml_beside(__file__, "task_sentences_own.yaml")


@pytest.fixture
def own_pages():
    """Installs pages, of which some take words of Errand's own sentences, beside the shipped tasks."""
    with tasks_installed(*PAGES) as found:
        yield found


@pytest.mark.parametrize("said", OWN["errands"])
def test_a_page_takes_no_clause_that_errand_reads_without_it(own_pages, parser, flat, said):
    beside = written(said, parser, flat)
    with tasks_installed(*(each for each in own_pages.values() if each not in PAGES), beside=False):
        assert written(said, parser, flat) == beside


@pytest.mark.parametrize(
    ("said", "meant"),
    [row for rows in ("parts", "quotations", "rounds", "unkept") for row in OWN[rows].items()],
)
def test_a_page_has_its_kinds_of_parts_quotations_rounds_and_limits(own_pages, parser, flat, said, meant):
    understood_or_refused(said, meant, parser, flat)


FRESH = yaml_beside(__file__, "task_sentences_fresh.yaml")


class VacuumRoom(Vacuum):
    """Cleans the floor of a room."""

    goal_is = Part.ROOM
    sentences = ({"template": "(vacuum|hoover) [{room:goal}]", "samples": ["vacuum the kitchen"]},)


@pytest.mark.parametrize(("said", "meant"), FRESH.items())
def test_a_fresh_sentence_with_the_tasks_of_the_tutorial_is_understood_or_refused(parser, flat, said, meant):
    with tasks_installed(VacuumRoom(), WaterObject(), ReadNumber()):
        understood_or_refused(said, meant, parser, flat)


def test_a_task_for_one_object_refuses_several(house_tasks, parser, knowledge):
    assert "is for one object at a time" in written("water two beers", parser, knowledge)
