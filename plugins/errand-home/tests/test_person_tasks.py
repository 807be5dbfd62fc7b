"""Tasks on described people pass the suite that every task should pass."""

from collections.abc import Mapping
from typing import ClassVar

from errand_home.tasks import Answer, Deliver, Report, Seek
from executive.app.task_suite import TaskSuite


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
