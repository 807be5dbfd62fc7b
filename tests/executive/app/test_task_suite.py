"""The suite of tests of a task: which faults its tests find, and what they show."""

from typing import ClassVar

import pytest

from executive.app.task_suite import TaskSuite
from tests.executive.house_tasks import Call, Vacuum


class Suite(TaskSuite):
    """Suite of a task whose sentence means another place than it says."""

    __test__ = False
    task = Vacuum
    commands: ClassVar = {"vacuum the kitchen": "Take [Nothing] to [hall] and do [vacuum] to [Nothing]"}


@pytest.fixture
def suite(house_tasks):
    """The suite with its task installed."""
    return Suite()


def test_a_failed_test_shows_what_was_understood(suite):
    with pytest.raises(AssertionError, match=r"Take \[Nothing\] to \[kitchen\] and do \[vacuum\]"):
        suite.test_sentences_mean_their_commands()


def test_a_task_passes_its_tests(suite, monkeypatch):
    monkeypatch.setattr(Suite, "commands", {"vacuum the hall": Suite.commands["vacuum the kitchen"]})
    for name in vars(TaskSuite):
        if name.startswith("test_"):
            getattr(suite, name)()


def test_a_template_that_takes_sentences_of_errand_itself_is_named(suite, house_tasks, monkeypatch):
    announce = {"template": "(call out|announce) {text:object}", "samples": ["call out dinner is ready"]}
    monkeypatch.setattr(Call, "sentences", (announce,))
    monkeypatch.setattr(Suite, "task", Call)
    with pytest.raises(AssertionError, match="a sentence of Errand itself, is also one of task 'call'"):
        suite.test_no_sentence_is_that_of_another_task()
