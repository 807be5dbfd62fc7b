"""Tasks on described people pass the suite that every task should pass."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import ClassVar

from errand_home.tasks import Answer, Deliver, Report, Seek
from executive.app.runs.goal_conditions import conditions_of
from executive.app.task_suite import TaskSuite
from executive.run.outcome import Execution, Outcome
from executive.tree.plan import StepPart
from executive.words.goal import GoalCondition, GoalKind, When


class TestSeek(TaskSuite):
    task, world = Seek, "home"
    commands: ClassVar[Mapping[str, str]] = {
        "find the waving person in the kitchen": "Take [Nothing] to [kitchen] and do [seek] to [waving person]",
        "locate a guest who is seated at the desk": "Take [Nothing] to [desk] and do [seek] to [sitting person]",
    }


class TestReport(TaskSuite):
    task, world = Report, "home"
    commands: ClassVar[Mapping[str, str]] = {
        "tell me the time": "Take [Nothing] to [start] and do [report] to [time]",
        "tell me the pose of the person at the desk": (
            "Take [Nothing] to [start] and do [report] to [pose of the person at the desk]"
        ),
        "tell me how many people in the study are waving": (
            "Take [Nothing] to [start] and do [report] to [number of waving people in the study]"
        ),
    }


class TestAnswer(TaskSuite):
    task, world = Answer, "home"
    commands: ClassVar[Mapping[str, str]] = {"answer a quiz": "Take [Nothing] to [Nothing] and do [answer] to [quiz]"}


class TestDeliver(TaskSuite):
    task, world = Deliver, "home"
    commands: ClassVar[Mapping[str, str]] = {}

    def test_sentences_mean_their_commands(self) -> None:
        """A delivery is a command behind the one that takes the object."""
        meant = self._commands("bring a cola from the desk to the waving person in the study")
        take = "Take [Nothing] to [desk] and do [grasp] to [cola]"
        assert meant == [take, "Take [cola] to [study] and do [deliver] to [waving person]"]


def test_an_object_that_a_plug_ins_task_hands_over_need_not_be_held_to_the_end():
    held = GoalCondition(GoalKind.GRASPED, ("cola",))
    parts = [StepPart("0", goal=held), StepPart("1", goal=GoalCondition(GoalKind.OWN, ("cola",), task="deliver"))]
    tree = SimpleNamespace(parts=parts, robot_name="Alice")
    runs = [Execution("0", 0.0, 5.0, done=True, succeeded=True), Execution("1", 6.0, 9.0, done=True, succeeded=True)]
    result = SimpleNamespace(executions=runs, outcome=Outcome.SUCCESS, preempting=(), said=(), stepped_aside=False)
    result.moved_s = 9.0
    assert [one.when for one in conditions_of(tree, result)] == [When.END_OF_STEP, When.END_OF_MISSION]
