"""Tests of speech: said once, for as long as it takes, or refused."""

from types import SimpleNamespace

import pytest

from skills.api import Cause, Running, Succeeded
from skills.small.speak import LONGEST_TEXT, Speak, SpeakInputs, SpeakOptions
from skills.stack import default_stack
from skills.testing.clock import VirtualClock


@pytest.fixture
def said():
    return []


@pytest.fixture
def skill(said):
    clock, robot = VirtualClock(), SimpleNamespace(name="Alice")
    publish = lambda topic, message: said.append((topic, message))  # noqa: E731
    loud = {"silent_zone": lambda: None, "stack": default_stack()}
    return Speak(SimpleNamespace(robot=robot, clock=clock, publish=publish, **loud))


def time_taken(skill, text):
    skill.begin(SpeakInputs(text))
    while isinstance(step := skill.step(), Running):
        skill.context.clock.advance(0.05)
    skill.end()
    return skill.context.clock.now(), step


@pytest.mark.parametrize(("text", "lasts_s"), [("Hello", 0.5), ("one two three four", 1.4), ("a " * 20, 7.0)])
def test_it_takes_as_long_as_saying_it(skill, text, lasts_s):
    took_s, step = time_taken(skill, text)
    assert isinstance(step, Succeeded)
    assert took_s == pytest.approx(lasts_s, abs=0.06)


def test_it_is_published_once_when_it_begins(skill, said):
    skill.begin(SpeakInputs("Dinner \n is ready."))
    assert said == [("speech", {"robot": "Alice", "text": "Dinner is ready.", "t": 0.0})]
    assert skill.step() == Running('says "Dinner is ready."', 0.0)
    _, step = time_taken(skill, "Dinner is ready.")
    assert (len(said), step.message) == (2, 'said "Dinner is ready."')


def test_after_a_pause_it_is_not_said_again_and_after_a_restart_it_is(skill, said):
    skill.begin(SpeakInputs("Hello"))
    skill.suspend()
    skill.resume(SpeakInputs("Hello"))
    assert len(said) == 1
    Speak(skill.context).resume(SpeakInputs("Hello"))
    assert len(said) == 2


@pytest.mark.parametrize(("text", "why"), [("", "nothing to say"), (" \n", "nothing"), ("x" * 501, "501 characters")])
def test_an_unspeakable_text_is_refused(skill, said, text, why):
    skill.begin(SpeakInputs(text))
    step = skill.step()
    assert step.cause is Cause.PRECONDITION
    assert why in step.message
    assert said == []


def test_the_longest_text_is_said(skill, said):
    skill.begin(SpeakInputs("x" * LONGEST_TEXT))
    assert len(said) == 1


def test_a_stack_sets_how_fast_it_speaks(skill):
    slow = Speak(skill.context, SpeakOptions(word_s=2.0))
    assert time_taken(slow, "one two")[0] == pytest.approx(4.0, abs=0.06)


def test_in_a_silent_zone_the_text_is_shown_and_not_spoken(skill, said):
    skill.context.silent_zone = lambda: "bedroom"
    seconds, step = time_taken(skill, "Dinner is ready and the table is set.")
    assert said[0][1]["silent"] == "bedroom"
    assert seconds < 0.6
    assert step.message == 'showed "Dinner is ready and the table is set." without a sound: bedroom is a silent zone'
