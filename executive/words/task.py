"""Tasks of *do [task] to [object]*: each is a class of its own behind an entry point, with all that Errand asks of it.

Words and sentences need what a `Task` says of itself; its plan and its promise are in `executive.tree.task_page`.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Any, ClassVar, Final

from pydantic_core import PydanticKnownError, core_schema

from executive.words.goal import GoalCondition
from skills.inputs import plugins
from skills.inputs.errors import InputError, listing
from skills.inputs.plugins import OURS, TASKS, PluginDefect, distribution_of, installed_plugins, run_plugin
from skills.quantities import QuantityError

NOTHING: Final = "Nothing"


class Part(enum.Enum):
    """Kind of a part of a command, such as the object of a task."""

    NOTHING = "nothing"
    THING = "thing"
    PERSON = "person"
    PLACE = "place"
    ROOM = "room"
    TIME = "time"
    NUMBER = "number"
    TEXT = "text"


class Task:
    """Task of a command. A subclass describes one task, and is registered by its word under `errand.tasks`.

    `object_is` tells the kind of its object, `goal_is` that of its goal, which may be left out unless `needs_goal`, and
    `item_is` that of an item that is carried there; the robot carries none to a task that leaves it Nothing.
    `several` tells whether the object may be several things. A task that `takes` closes the gripper on its object, one
    that `puts` opens it, one that `looks` answers whether its object is there, one that `docks` charges the battery,
    one that `moves` takes the person of its object elsewhere, and one that `meets` goes to that person.

    `sentences` are rows of sentence templates (`executive.language.templates`) with their samples; the slots `goal`
    and `object` fill the command, and the page's `rules` may be used. `verbs` begin more of its requests; `past` has
    their irregular past forms (`{"swept": "sweep"}`). `spoken` has samples of a task whose requests are read elsewhere;
    `ability` is what the robot says that it can do (by default the word of a task with sentences). `unkept` are rows of
    a regular expression `said` and the `reason` why the task does not keep such words, which {} quotes. A task that
    `answers` publishes what it has found out. `number` stands for the task in messages.
    """

    word: ClassVar[str]
    object_is: ClassVar[Part] = Part.NOTHING
    goal_is: ClassVar[Part] = Part.NOTHING
    item_is: ClassVar[Part] = Part.NOTHING
    needs_goal: ClassVar[bool] = False
    several: ClassVar[bool] = False
    takes: ClassVar[bool] = False
    puts: ClassVar[bool] = False
    looks: ClassVar[bool] = False
    docks: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    meets: ClassVar[bool] = False
    number: ClassVar[int] = 255
    sentences: ClassVar[tuple[Mapping[str, Any], ...]] = ()
    verbs: ClassVar[tuple[str, ...]] = ()
    spoken: ClassVar[tuple[str, ...]] = ()
    unkept: ClassVar[tuple[Mapping[str, str], ...]] = ()
    ability: ClassVar[str] = ""
    rules: ClassVar[Mapping[str, str]] = MappingProxyType({})
    past: ClassVar[Mapping[str, str]] = MappingProxyType({})
    answers: ClassVar[bool] = False

    @property
    def samples(self) -> tuple[str, ...]:
        """Samples of its sentences."""
        return tuple(sample for row in self.sentences for sample in row["samples"]) or self.spoken

    @property
    def named(self) -> str:
        """Name with the distribution that registers the task."""
        return f"task '{self.word}' of {self.owner or 'an unknown distribution'}"

    @property
    def owner(self) -> str:
        """Distribution that registers the task; empty when none does."""
        return next((distribution_of(each) for each in installed_plugins(TASKS) if each.name == self.word), "")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Task) and other.word == self.word

    def __hash__(self) -> int:
        return hash(self.word)

    def __repr__(self) -> str:
        return f"<task {self.word}>"

    def judge(self, condition: GoalCondition, truth: Any) -> tuple[bool, str]:
        """Judges a goal condition of kind OWN by a simulation's `plant.referee.Truth`: whether it holds, and why.

        By default it holds for no truth, since only a page that promises such a condition judges it.
        """
        return False, f"nobody judges '{self.word}'."

    @classmethod
    def __get_pydantic_core_schema__(cls, _: Any, __: Any) -> core_schema.CoreSchema:
        def read(value: Any) -> Task:
            if isinstance(value, Task):
                return value
            if not is_task(value):
                raise PydanticKnownError("enum", {"expected": listing(map(repr, installed_tasks()), last="or")})
            return task_named(value)

        as_word = core_schema.plain_serializer_function_ser_schema(lambda task: task.word, when_used="json")
        return core_schema.no_info_plain_validator_function(read, serialization=as_word)

    @classmethod
    def __get_pydantic_json_schema__(cls, _: Any, __: Any) -> dict[str, Any]:
        return {"enum": list(installed_tasks()), "type": "string", "title": "Task", "description": "A task."}


def task_named(word: object) -> Task:
    """Returns the task of a word. Raises QuantityError for a word that no installed task has."""
    if word in installed_tasks():
        return installed_tasks()[str(word)]
    known = f"known are {', '.join(installed_tasks())} and {NOTHING}"
    raise QuantityError(*_missing(word) or (f"[{word}] is no task", known))


def is_task(word: object) -> bool:
    """Returns whether a word is a task, also one that cannot be used or whose plug-in is not installed."""
    return isinstance(word, str) and (word in installed_tasks() or _missing(word) is not None)


def _missing(word: object) -> tuple[str, str] | None:
    """Message and hint for the word of a task that cannot be used, or whose plug-in is not installed."""
    broken = broken_tasks().get(str(word))
    return plugins.missing_plugin(TASKS, str(word)) if broken is None else (broken.message, broken.hint)


def installed_tasks() -> Mapping[str, Task]:
    """Returns the installed tasks that can be used, by word, in the order of their numbers."""
    return _found()[0]


def broken_tasks() -> Mapping[str, InputError]:
    """Returns the errors of tasks that cannot be used, by word."""
    return _found()[1]


@cache
def _found() -> tuple[Mapping[str, Task], Mapping[str, InputError]]:
    tasks, broken, entries = dict[str, Task](), dict[str, InputError](), dict[str, list[EntryPoint]]()
    for entry in sorted(installed_plugins(TASKS), key=distribution_of):
        same = entries.setdefault(entry.name, [])
        same.insert(0 if distribution_of(entry) == OURS else len(same), entry)
    for word, (entry, *others) in entries.items():
        try:
            if others and distribution_of(entry) != OURS:
                owners = listing(map(distribution_of, (entry, *others)))
                raise InputError(f"{owners} register a task '{word}'", hint="uninstall one, or rename its task")
            tasks[word] = task_of(entry)
        except InputError as error:
            broken[word] = error
    ordered = sorted(tasks.items(), key=lambda named: (named[1].number, named[0]))
    return MappingProxyType(dict(ordered)), MappingProxyType(broken)


def task_of(entry: EntryPoint) -> Task:
    """Loads and checks the task behind an entry point. Raises InputError when it cannot be used."""
    try:
        kind = run_plugin(entry, entry.load)
        fault = next(_faults(kind, entry.name), None)
        if fault is None:
            task: Task = run_plugin(entry, kind)
            return task
    except PluginDefect as defect:
        fault = f"cannot load {entry.value} ({defect})", "repair or uninstall that distribution"
    raise InputError(f"task '{entry.name}' of distribution {distribution_of(entry)}: {fault[0]}", hint=fault[1])


def _faults(kind: Any, word: str) -> Iterator[tuple[str, str]]:
    """Yields a message with a hint for each rule for tasks that a class breaks."""
    if not (isinstance(kind, type) and issubclass(kind, Task)):
        yield "it is no subclass of executive.tree.task_page.TaskPage", "register the task's class"
        return
    own = getattr(kind, "word", None)
    if own != word:
        said = "it has no word" if own is None else f"it calls itself {own!r}"
        yield said, f"register it under its own word, or set word = {word!r}"
    if not (word.isidentifier() and word == word.lower()):
        yield f"{word!r} is no word in lower case", "name it by a verb, as in 'vacuum'"
    if not (kind.__dict__.get("__doc__") or "").strip():
        yield "it has no docstring", "say in one sentence what it does"
    if not (isinstance(kind.sentences, tuple) and all(map(_is_row, kind.sentences))):
        row = "({'template': 'vacuum {place:goal}', 'samples': ['vacuum the hall']},)"
        yield "its sentences are no rows of a template with samples", f"write {row}"
    if not (isinstance(kind.verbs, tuple) and all(isinstance(verb, str) and verb.isalpha() for verb in kind.verbs)):
        yield "its verbs are no single words", "write ('mop', 'wipe'), for instance"
    if not (isinstance(kind.unkept, tuple) and all(map(_is_reason, kind.unkept))):
        yield "its rows of unkept words have no expression 'said' with a 'reason'", "see executive.words.task.Task"
    for name, (what, usual) in _FACTS.items():
        given = getattr(kind, name)
        texts = given.items() if isinstance(given, Mapping) else [given] if isinstance(given, tuple) else []
        if not isinstance(given, what) or not all(isinstance(each, str) for pair in texts for each in pair):
            yield f"its {name} is {str(given)[:60]!r}", f"write {usual}, for instance"
    if missing := getattr(kind, "__abstractmethods__", ()):
        yield f"it does not define {listing(sorted(missing))}", f"define {listing(sorted(missing))}"


_FACTS: Final[Mapping[str, tuple[Any, str]]] = {
    "rules": (Mapping, "{'how': '(wetly|drily)'}"),
    "past": (Mapping, "{'swept': 'sweep'}"),
    "ability": (str, "'sweep floors'"),
    "number": (int, "255"),
    "spoken": (tuple, "('sweep the hall',)"),
    **dict.fromkeys(("object_is", "goal_is", "item_is"), (Part, "Part.PLACE")),
    **dict.fromkeys(("needs_goal", "several", "answers"), (bool, "True")),
}
"""Facts of a page by name: their types, and an example."""


def _is_row(row: Any) -> bool:
    """Returns whether a row of sentences has a template and samples of it."""
    samples = row.get("samples") if isinstance(row, Mapping) else None
    texts = [row["template"], *samples] if isinstance(samples, list | tuple) and samples and "template" in row else []
    return bool(texts) and all(isinstance(text, str) for text in texts)


def _is_reason(row: Any) -> bool:
    """Returns whether a row of unkept words has an expression that can be read, and a reason."""
    try:
        re.compile(row["said"])
        return isinstance(row["reason"].format(""), str)
    except (AttributeError, LookupError, TypeError, ValueError, re.error):
        return False


@dataclass(frozen=True)
class BasicTasks:
    """Tasks of which the executive itself composes commands: a fetch, for instance, takes an object and carries it."""

    take: Task
    put: Task
    look: Task
    wait: Task
    charge: Task


@cache
def basic() -> BasicTasks:
    """Returns the basic tasks, which this project's tasks are by what they say of themselves."""
    tasks = tuple(installed_tasks().values())
    takes, puts, looks, docks = (
        next(task for task in tasks if getattr(task, fact)) for fact in ("takes", "puts", "looks", "docks")
    )
    return BasicTasks(takes, puts, looks, next(task for task in tasks if task.object_is is Part.TIME), docks)
