""" "Her" and "him" mean the last person in a statement, also with an unknown name."""

import pytest

from executive.language.parser import load_parser
from executive.language.understand import Status, understand


@pytest.fixture(scope="module")
def parser():
    return load_parser()


@pytest.mark.parametrize("name", ["Tracy", "Mary", "Odo"])
def test_people_in_statements_can_receive_objects(parser, name):
    text = f"{name} is at the desk, bring her the tuna."
    meaning = understand(text, parser=parser, knowledge=None, require_wake=False)
    assert meaning.status is Status.OK
    assert (meaning.commands[-1].goal, meaning.commands[-1].goal_at) == (name, "desk")


def test_her_own_object_is_brought_to_her(parser):
    meaning = understand("Linda is at her desk, bring her her tuna.", parser=parser, knowledge=None, require_wake=False)
    assert (meaning.commands[-1].goal, meaning.commands[-1].goal_at) == ("Linda", "desk")


def test_statement_on_an_object_keeps_it_definite(parser):
    meaning = understand("Coke is on the table, bring it here.", parser=parser, knowledge=None, require_wake=False)
    assert meaning.commands[0].goal == "table"
