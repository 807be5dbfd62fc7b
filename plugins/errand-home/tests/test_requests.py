"""Sentences that compare objects mean the task compare, and no sample matches two templates."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import pytest

import errand_home
import executive
from errand_home.tasks import Compare
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.task_suite import TaskSuite
from executive.language.templates import Page, Template

PAGE = Page(
    "home", file=Path(errand_home.__file__).with_name("home.yaml"), names=("Robin",), around=("desk", "kitchen")
)
ROWS = PAGE.table["intents"]["compares"]


DO = "Take [Nothing] to [{}] and do [compare] to [{}]"


class TestCompare(TaskSuite):
    task, world = Compare, "home"
    commands: ClassVar[Mapping[str, str]] = {
        "tell me what is the biggest object on the desk": DO.format("desk", "biggest object"),
        "tell me which are the two heaviest drinks on the counter": DO.format("kitchen counter", "2 heaviest drink"),
        "tell me the lightest cleaning supply on the trolley": DO.format("serving trolley", "lightest cleaning supply"),
        "which fruit on the dining table is the smallest": DO.format("dining table", "smallest fruit"),
        "tell me what are the three thinnest dishes in the kitchen": DO.format("kitchen", "3 thinnest dish"),
    }


@pytest.mark.parametrize("n", range(len(ROWS)))
def test_each_sample_matches_its_template(n):
    template, earlier = Template(PAGE, [ROWS[n]]), Template(PAGE, ROWS[:n])
    for sample in ROWS[n]["samples"]:
        assert template.fullmatch(sample) is not None, sample
        assert earlier.fullmatch(sample) is None, sample


# sentence, reason of the refusal or the question
@pytest.mark.parametrize(
    ("sentence", "says"),
    [
        ("tell me what is the biggest unicorn on the desk", "I know no 'unicorn'"),
        ("tell me what is the biggest drink on the moon", "moon"),
        ("tell me what are the many biggest drinks on the desk", "I do not understand"),
    ],
)
def test_a_comparison_that_is_not_clear_is_refused(sentence, says):
    found = executive.parse(sentence, knowledge=knowledge_of(open_world("home")))
    assert (found.commands, says in (found.reason or "")) == ((), True), found.reason


def test_other_sentences_about_big_objects_keep_their_meaning():
    found = executive.parse("bring me the biggest drink from the desk", knowledge=knowledge_of(open_world("home")))
    assert str(found.commands[0]) == "Take [Nothing] to [desk] and do [grasp] to [drink biggest of all]"
