"""Conditions that always or never hold."""

import pytest
from pydantic import TypeAdapter

from executive.mission.certainty import refuse_certain, refuse_certain_comparisons
from executive.words.condition import RANGES, Condition, ValueIs
from executive.words.expression import Expression, ExpressionError
from skills.quantities import Tries
from tests.tables import yaml_beside

NAMES = {**RANGES, "count": Tries}
ROWS = yaml_beside(__file__, "certain.yaml")
condition_of = TypeAdapter(Condition).validate_python


@pytest.mark.parametrize(("text", "says", "hint"), ROWS["comparisons"])
def test_a_comparison_that_the_range_decides_is_refused(text, says, hint):
    with pytest.raises(ExpressionError) as error:
        refuse_certain_comparisons(Expression(text), NAMES)
    assert says in error.value.message
    assert hint in error.value.hint


@pytest.mark.parametrize("text", ROWS["open_comparisons"])
def test_a_comparison_that_may_go_either_way_is_taken(text):
    refuse_certain_comparisons(Expression(text), NAMES)
    refuse_certain(ValueIs(expression=text), NAMES)


@pytest.mark.parametrize(("condition", "says"), ROWS["conditions"], ids=str)
def test_a_condition_whose_parts_contradict_each_other_is_refused(condition, says):
    with pytest.raises(ExpressionError, match=says):
        refuse_certain(condition_of(condition), NAMES)


@pytest.mark.parametrize("condition", ROWS["open_conditions"], ids=str)
def test_a_condition_that_may_go_either_way_is_taken(condition):
    refuse_certain(condition_of(condition), NAMES)
