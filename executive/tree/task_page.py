"""Pages of tasks: what a task says of itself, its plan, and what it promises."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from executive.words.task import Task
from skills.inputs.errors import InputError
from skills.inputs.plugins import PluginDefect, call_plugin

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder
    from executive.words.command import Command
    from executive.words.goal import GoalCondition
    from executive.words.knowledge import Knowledge

ResultT = TypeVar("ResultT")


class TaskPage(Task, abc.ABC):
    """All about one task: a subclass on a page of its own, with the task's facts, sentences, plan and promise."""

    @abc.abstractmethod
    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans the command of a builder. Raises InputError when it is incomplete or impossible."""

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition | None:
        """Goal condition by which the referee judges a command; None (by default): it is not judged.

        The robot may also find its object on the surfaces `elsewhere`.
        """
        return None


def page_of(task: Task) -> TaskPage:
    """Returns a task as its page, which each registered task is."""
    assert isinstance(task, TaskPage)
    return task


def from_page(task: Task, method: str, call: Callable[[TaskPage], ResultT], *kinds: type) -> ResultT:
    """Returns what a `method` of a page gives, one of some kinds. Raises InputError for defects, naming the task."""
    try:
        found = call_plugin(lambda: call(page_of(task)))
        if isinstance(found, kinds):
            return found
        fault = f"it returns {found!r}"
    except PluginDefect as defect:
        if isinstance(defect.__cause__, InputError):
            raise defect.__cause__ from None
        fault = str(defect)
    raise defective(task, method, fault)


def defective(task: Task, method: str, fault: str) -> InputError:
    """Builds the error for a `method` of a task's page that has a defect."""
    what = f"the method '{method}' of {task.named} has a defect: {fault}"
    return InputError(what[:300], hint=f"repair its page, {type(task).__module__}")
