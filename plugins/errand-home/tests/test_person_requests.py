"""Sentences about people who are described mean the commands of their tasks; unclear ones are refused."""

from pathlib import Path

import pytest

import errand_home
import executive
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.language.templates import Page, Template
from executive.words.leaf_steps import Speak
from tests.tables import yaml_beside

SENTENCES = yaml_beside(__file__, "person_sentences.yaml")
PAGE = Page(
    "persons",
    file=Path(errand_home.__file__).with_name("persons.yaml"),
    names=("Robin", "Jane"),
    around=("desk", "kitchen"),
)
ROWS = PAGE.table["intents"]["requests"]


def parsed(sentence):
    return executive.parse(sentence, knowledge=knowledge_of(open_world("home")))


def outline(step):
    """A step as in the table: the place or person, the task and its object."""
    if isinstance(step, Speak):
        return f'"{step.speak}"'
    at = "" if step.goal_at is None else f" at {step.goal_at}"
    return f"{step.goal or 'here'}{at} {f'{step.task.word} {step.object}' if step.task else 'go'}"


def leaves(steps):
    """Steps and commands of a mission, in order."""
    for step in steps:
        if isinstance(step, Speak):
            yield step
        elif step.inner_steps:
            yield from leaves(step.inner_steps)
        else:
            yield from step.commands


@pytest.mark.parametrize("sentence", SENTENCES["understood"])
def test_a_sentence_about_people_means_its_commands(sentence):
    found = parsed(sentence)
    assert found.status.name == "OK", found.reason
    assert [*map(outline, leaves(found.all_steps))] == SENTENCES["understood"][sentence]


@pytest.mark.parametrize("sentence", SENTENCES["refused"])
def test_a_sentence_that_is_not_clear_is_refused(sentence):
    found = parsed(sentence)
    assert found.status.name != "OK", [*map(outline, leaves(found.all_steps))]
    assert SENTENCES["refused"][sentence].lower() in (found.reason or "").lower()


@pytest.mark.parametrize("n", range(len(ROWS)))
def test_each_sample_matches_its_template(n):
    template, earlier = Template(PAGE, [ROWS[n]]), Template(PAGE, ROWS[:n])
    for sample in ROWS[n]["samples"]:
        assert template.fullmatch(sample) is not None, sample
        assert earlier.fullmatch(sample) is None, sample


def test_the_answer_notes_that_the_colour_decides():
    notes = parsed("tell me how many people in the kitchen are wearing red coats").notes
    assert notes == ("the kind of clothing is not told apart; in 'people wearing red coats' the colour decides",)


@pytest.mark.parametrize(
    "sentence",
    [
        "follow me",
        "follow the person standing in front of you",
        "greet everybody in the kitchen",
    ],
)
def test_other_sentences_about_people_keep_their_meaning(sentence):
    found = parsed(sentence)
    assert found.status.name == "OK", found.reason
    assert not any(each.task is not None and each.task.word == "seek" for each in found.commands)


def test_a_clause_before_is_refused_by_its_own_reason():
    assert "coat" in (parsed("bring me a coat and tell me the time").reason or "")
