"""The detect skill with relations: the object that is meant, questions where two fit, and reasons where none does."""

from dataclasses import dataclass, replace

import pytest
from table_robot import TableRobot, context_of, failed, outcome
from table_scene import BLUE, COKE, TABLE, Can

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs
from skills.relations import Landmark, Relation, RelationKind
from skills.robot import Pose2D

LEFT, RIGHT = replace(COKE, x=1.05, y=0.4), replace(COKE, x=1.05, y=-0.35)
BEER = Can(1.05, 0.22, 0.03, 0.23, BLUE)
MIDDLE_BEER = replace(BEER, y=0.02)
A_BEER = Landmark("beer", classes=("beer",))
COKES = DetectInputs(("coke",), (TABLE,))


def inputs_of(kind, *landmarks, nth=1, **others):
    return replace(COKES, relations=(Relation(kind, landmarks, nth),), **others)


def found(things, inputs):
    step = outcome(Detect(context_of(TableRobot(things=things))), inputs)
    assert isinstance(step, Succeeded), step
    return [round(each.position_W[1], 1) for each in step.outputs["observations"]]


@pytest.mark.parametrize(
    ("inputs", "y"),
    [
        (inputs_of(RelationKind.NEXT_TO, A_BEER), LEFT.y),
        (inputs_of(RelationKind.LEFT_OF, A_BEER), LEFT.y),
        (inputs_of(RelationKind.RIGHT_OF, A_BEER), RIGHT.y),
        (inputs_of(RelationKind.RIGHT, nth=2), LEFT.y),
    ],
    ids=["next to", "left of", "right of", "2nd from the right"],
)
def test_the_object_that_is_meant_is_found(inputs, y):
    assert found([LEFT, RIGHT, BEER], inputs) == [pytest.approx(y, abs=0.06)]


def test_left_is_told_from_the_viewer_of_the_surface():
    behind = replace(TABLE, viewer=Pose2D(3.0, 0.0, 3.14159))
    inputs = replace(inputs_of(RelationKind.LEFT, nth=1), surfaces=(behind,))
    assert found([LEFT, RIGHT], inputs) == [pytest.approx(RIGHT.y, abs=0.06)]


@dataclass
class Answers:
    """Operator who answers each question with a text, and notes the questions."""

    text: str
    asked: list

    def __call__(self, question):
        self.asked.append(question)
        return self

    def done(self):
        return True

    def result(self):
        return self.text

    def withdraw(self):
        pass


TWO = [replace(LEFT, y=0.18), replace(RIGHT, y=-0.16), MIDDLE_BEER]


def test_all_objects_that_are_meant_are_counted():
    assert sorted(found([*TWO, LEFT], inputs_of(RelationKind.NEXT_TO, A_BEER, count=0))) == [-0.2, 0.2]


def test_the_robot_asks_which_of_two_is_meant():
    operator = Answers("2nd from the left", [])
    context = replace(context_of(TableRobot(things=TWO)), ask=operator)
    step = outcome(Detect(context), inputs_of(RelationKind.NEXT_TO, A_BEER))
    assert isinstance(step, Succeeded), step
    assert step.outputs["observation"].position_W[1] == pytest.approx(-0.16, abs=0.03)
    (question,) = operator.asked
    assert question.text == "there are two cokes on the table next to the beer: which one?"
    assert question.options == ("1st from the left", "2nd from the left")


@pytest.mark.parametrize(
    ("things", "inputs", "cause", "part"),
    [
        (
            TWO,
            inputs_of(RelationKind.NEXT_TO, A_BEER),
            Cause.PRECONDITION,
            "next to the beer, and it is not said which",
        ),
        (
            [LEFT, RIGHT],
            inputs_of(RelationKind.NEXT_TO, A_BEER),
            Cause.POSTCONDITION,
            "two cokes seen on the table, but not the beer, so it cannot be told which is next to the beer",
        ),
        (
            [RIGHT, BEER],
            inputs_of(RelationKind.LEFT_OF, A_BEER),
            Cause.POSTCONDITION,
            "one coke seen on the table, but none left of the beer",
        ),
        (
            [LEFT, RIGHT],
            inputs_of(RelationKind.LEFT, nth=3),
            Cause.POSTCONDITION,
            "two cokes seen on the table, but none 3rd from the left",
        ),
        ([BEER], inputs_of(RelationKind.NEXT_TO, A_BEER), Cause.POSTCONDITION, "no coke seen on the table"),
        (
            [LEFT],
            inputs_of(RelationKind.NEXT_TO, Landmark("unicorn", classes=("unicorn",))),
            Cause.PRECONDITION,
            "what unicorn looks like",
        ),
    ],
    ids=["two fit", "no landmark", "none fits", "too few", "no object", "unknown landmark"],
)
def test_a_search_fails_with_its_reason(things, inputs, cause, part):
    failed(Detect(context_of(TableRobot(things=things))), inputs, cause, part)


def test_the_search_views_the_whole_surface_only_for_relations():
    robots = [TableRobot(things=[LEFT, RIGHT]) for _ in range(2)]
    for robot, inputs in zip(robots, (COKES, inputs_of(RelationKind.LEFT)), strict=True):
        assert isinstance(outcome(Detect(context_of(robot)), inputs), Succeeded)
    assert robots[0].now() < robots[1].now()
