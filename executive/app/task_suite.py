"""Test suite that every task should pass: its sentences mean it and nothing else, and compile.

Write a class in a test file and pytest runs all of it:

    class TestVacuum(TaskSuite):
        task = Vacuum
        commands = {"vacuum the kitchen": "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"}
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import executive
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.language.task_sentences import other_readings
from executive.tree.task_page import TaskPage
from executive.words.task import installed_tasks


class TaskSuite:
    """Tests of a `task` that is installed, by its samples and by more `commands` in the words of a world.

    The placeholders of samples, such as names of places, are those of `world`.
    """

    task: ClassVar[type[TaskPage]]
    commands: ClassVar[Mapping[str, str]] = {}
    world: ClassVar[str] = "flat"

    def test_it_is_installed(self) -> None:
        """`errand plugins` names what is wrong with one that is not."""
        assert isinstance(installed_tasks().get(self.task.word), self.task)

    def test_sentences_mean_their_commands(self) -> None:
        """Each sentence of `commands` is understood as its command, and nothing is left out."""
        assert self.commands, "name a sentence or more, with the commands that they mean"
        meant = {sentence: self._commands(sentence) for sentence in self.commands}
        assert meant == {sentence: [command] for sentence, command in self.commands.items()}

    def test_samples_mean_this_task(self) -> None:
        """Each sample of the task's page is understood, in a world, as this task."""
        samples = [sample for row in self.task.sentences for sample in row["samples"]]
        meant = {sample: self._commands(sample) for sample in samples}
        own = f"do [{self.task.word}]"
        assert {sample: found for sample, found in meant.items() if own not in " ".join(found)} == {}

    def test_no_sentence_is_that_of_another_task(self) -> None:
        """No sample of this task is also a sentence of another one that is installed, and none of theirs is of this."""
        assert list(other_readings(self.task.word)) == []

    def test_commands_compile(self) -> None:
        """A mission of each command has a plan."""
        for sentence in self.commands:
            assert executive.check(sentence, world=self.world).errors == ()

    def _commands(self, sentence: str) -> list[str]:
        found = executive.parse(sentence, knowledge=knowledge_of(open_world(self.world)))
        return [str(command) for command in found.commands] or [found.reason or ""]
