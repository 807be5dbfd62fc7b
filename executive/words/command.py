"""Commands of the form *Take [item] to [goal] and do [task] to [object]*, and their text form.

A name with several words needs no quotes ("[orange juice]"). If its words could be read as attributes, a number or
Nothing, the text form puts the name in quotes ('["red wine"]'), so that every command parses back to itself. Relations
follow the name: "[hammer next to the wrench, 2nd from the left]".
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from executive.words.task import NOTHING, Part, Task, task_named
from skills.api import ObjectKind
from skills.quantities import Duration, Number, QuantityError, display_text, number_in, number_of
from skills.relations import ORDERS, PARTS, Landmark, Relation, RelationKind

_ATTRIBUTE: Final = re.compile(
    r"(?:non-)?(?:red|green|blue|yellow|orange|white|black|gr[ae]y|brown|pink|purple|violet|silver)"
    r"|golden|dark|bright|light"
    r"|big|small|large|little|tiny|huge|tall|short|long|wide|thin|thick|heavy|round|square|full|empty|open|closed"
    r"|clean|dirty|new|old|hot|cold|warm|fresh|wooden|plastic|metal|other|same|left|right|\w{3,}est",
    re.IGNORECASE,
)
START: Final = "start"
"""Goal at the pose where the robot stood when the speaker addressed it."""
SPEAKER: Final = "speaker"
"""Person who spoke to the robot, as the object of a task on people."""
TIME_UNITS_S: Final = {"second": 1.0, "seconds": 1.0, "minute": 60.0, "minutes": 60.0, "hour": 3600.0, "hours": 3600.0}
"""Seconds of each time unit that a command to wait takes as its object: "do [wait] to [10 second]"."""
NUMBERS: Final = (
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen", "twenty"),
)
_TIME: Final = re.compile(rf"(?:\d+ )?(?:{'|'.join(TIME_UNITS_S)})")
_PLURAL: Final = "some"
_RESERVED: Final = re.compile(r'[\[\]"]|^\s|\s$|\s\s|[^\S ]|^$')
_NO_ATTRIBUTE: Final = re.compile(rf"\d+|{_PLURAL}|.*\s.*")
_FORM: Final = re.compile(r"\s*Take \[(.+?)\] to \[(.+?)\] and do \[(.+?)\] to \[(.+?)\]\s*")
_GOAL: Final = re.compile(r'("[^"]+"|.+?)(?: at ("[^"]+"|.+))?')
_COUNTED: Final = re.compile(r'(?:(\d+|some) )?(?:([^"]*) )?(?:"([^"]+)"|([^"]+))')
_RELATION: Final = re.compile(
    rf'"[^"]*"|,? (?:(\d+)(?:st|nd|rd|th) )?({"|".join(kind.value for kind in RelationKind)})(?=,|$| the | [A-Z])'
)


@dataclass(frozen=True)
class Command:
    """Command to one robot. None stands for Nothing; a count of 0 is a plural without a number, 1 a singular.

    `goal` is a place or a person ("start": the pose where the robot stood when the speaker addressed it), `goal_at` the
    place where that person is, `verb` the spoken verb. `goal_relations` say where on a surface to put an object.

    Raises ValueError when a name contains brackets, quotes or stray blanks, a count is negative, Nothing is counted,
    `goal_at` is given without a goal, or two relations of an object or a goal are of one kind.
    """

    item: ObjectKind | None = None
    goal: str | None = None
    goal_at: str | None = None
    task: Task | None = None
    object: ObjectKind | None = None
    item_count: int = 1
    object_count: int = 1
    verb: str = ""
    goal_relations: tuple[Relation, ...] = ()

    def __post_init__(self) -> None:
        for name in (self.goal, self.goal_at, *_words(self.item), *_words(self.object), *_names(self.goal_relations)):
            if name is not None and _RESERVED.search(name):
                raise ValueError(f"{name!r} cannot be a name in a command")
        for kind, count in ((self.item, self.item_count), (self.object, self.object_count)):
            if count < 0 or (kind is None and count != 1):
                raise ValueError(f"{count} cannot be the count of {kind or NOTHING}")
            landmarks = () if kind is None else tuple(one for each in kind.relations for one in each.landmarks)
            described = () if kind is None else (kind.attributes, *(one.attributes for one in landmarks))
            if not all(may_be_attribute(word) for words in described for word in words):
                raise ValueError(f"{kind} has an attribute that is no single word, or a number")
        if (self.goal_at is not None or self.goal_relations) and self.goal is None:
            raise ValueError(f"a goal is missing at {self.goal_at or self.goal_relations[0]!s}")
        if self.goal_relations and (self.goal_at is not None or self.goal == NOTHING):
            raise ValueError(f"'{self.goal_relations[0]}' goes with a surface")
        for relations in (self.goal_relations, *(each.relations for each in (self.item, self.object) if each)):
            kinds = [next((group for group in (PARTS, ORDERS) if one.kind in group), one.kind) for one in relations]
            if len({*kinds}) < len(kinds):
                raise ValueError(f"two relations are of one kind in '{', '.join(map(str, relations))}'")

    def __str__(self) -> str:
        """Text form, for instance "Take [Nothing] to [kitchen] and do [grasp] to [drink]"."""
        item = _counted_text(self.item, self.item_count)
        task = NOTHING if self.task is None else self.task.word
        target = _counted_text(self.object, self.object_count)
        return f"Take [{item}] to [{_goal_text(self)}] and do [{task}] to [{target}]"

    @property
    def takes(self) -> bool:
        """Returns whether the robot takes hold of the object."""
        return self.task is not None and self.task.takes

    @property
    def puts(self) -> bool:
        """Returns whether the robot puts the object down."""
        return self.task is not None and self.task.puts

    @property
    def looks(self) -> bool:
        """Returns whether the robot looks for the object, and answers."""
        return self.task is not None and self.task.looks

    @property
    def about_person(self) -> bool:
        """Returns whether the object is a person."""
        return self.task is not None and self.task.object_is is Part.PERSON

    @property
    def amount(self) -> float | None:
        """Number that the object is, in seconds if the task is about a time; None for any other object."""
        kind, name = self.task and self.task.object_is, str(self.object).lower()
        if kind is not Part.NUMBER:
            unit_s = TIME_UNITS_S.get(name) if kind is Part.TIME else None
            return unit_s and unit_s * self.object_count
        try:
            return number_in(str(NUMBERS.index(name)) if name in NUMBERS else name, Number)
        except QuantityError:
            return None

    @property
    def carried(self) -> ObjectKind | None:
        """Object that the robot carries; None if it carries none."""
        return self.object if self.puts and self.item is None else self.item

    def to_json(self) -> dict[str, Any]:
        """Returns the command as JSON values: names as text, and null for Nothing, with count 0."""
        return {
            "item": None if self.item is None else str(self.item),
            "goal": self.goal and " ".join((self.goal, *map(str, self.goal_relations))),
            "goal_at": self.goal_at,
            "task": None if self.task is None else self.task.word,
            "object": None if self.object is None else str(self.object),
            "item_count": 0 if self.item is None else self.item_count,
            "object_count": 0 if self.object is None else self.object_count,
            "verb": self.verb,
        }


def is_attribute(word: str) -> bool:
    """Returns whether `word` is an attribute of the words that follow it ("red", "biggest")."""
    return _ATTRIBUTE.fullmatch(word) is not None


def may_be_attribute(word: str) -> bool:
    """Returns whether `word` can describe an object, like a colour: a single word that is no number."""
    return _NO_ATTRIBUTE.fullmatch(word) is None


def object_text(kind: Part, value: Any) -> Any:
    """Text in a command for the value that a file gives a task's object; a thing, a place or a person stays as it is.

    Raises QuantityError for a time of no whole seconds, a number or a text that cannot be in a command.
    """
    if kind is Part.TIME and not _TIME.fullmatch(str(value)):
        seconds = number_of(value, Duration)
        if not seconds.is_integer():
            raise QuantityError("should be whole seconds", f"it reads {display_text(value)} now")
        return f"{seconds:.0f} second"
    if kind is Part.NUMBER:
        (number_in if isinstance(value, str) else number_of)(value, Number)
        return str(value).strip()
    if kind is not Part.TEXT or isinstance(value, bool) or not isinstance(value, str | int | float):
        return value
    text = " ".join(str(value).split()).removeprefix('"').removesuffix('"')
    if _RESERVED.search(text):
        raise QuantityError(f"{display_text(text)} cannot be in a command", "leave brackets and double quotes out")
    return _counted_text(ObjectKind(text), 1)


def parse_object(text: str) -> ObjectKind:
    """Parses words as a kind of object: leading attributes, and the rest as its name."""
    words = text.split()
    first = next((n for n, word in enumerate(words) if not is_attribute(word)), len(words) - 1)
    return ObjectKind(" ".join(words[first:]), tuple(words[:first]))


def parse_command(text: str) -> Command:
    """Parses the text form of a command, which does not include its `verb`.

    Raises ValueError when the text is no command.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not of the form 'Take [item] to [goal] and do [task] to [object]'")
    item, goal, task, target = match.groups()
    item_kind, item_count = _parse_counted(item)
    target_kind, target_count = _parse_counted(target)
    place, relations = split_relations(goal)
    goal_name, goal_at = _parse_goal(place)
    tasks = None if task == NOTHING else task_named(task), target_kind, item_count, target_count
    return Command(item_kind, goal_name, goal_at, *tasks, goal_relations=relations)


def parts_of_command(command: Command) -> dict[str, str]:
    """Splits a command's text form into its parts by the keys of mission files; omits parts that are Nothing."""
    parts = {
        "take": _counted_text(command.item, command.item_count),
        "to": _goal_text(command),
        "do": NOTHING if command.task is None else command.task.word,
        "object": _counted_text(command.object, command.object_count),
    }
    return {key: text for key, text in parts.items() if text != NOTHING}


def command_of_parts(parts: Mapping[str, str | None]) -> Command:
    """Builds a command from its parts. Raises ValueError when a part cannot be parsed."""
    take, to, do, target = (parts.get(key) or NOTHING for key in ("take", "to", "do", "object"))
    return parse_command(f"Take [{take}] to [{to}] and do [{do}] to [{target}]")


def _words(kind: ObjectKind | None) -> tuple[str, ...]:
    return () if kind is None else (kind.name, *kind.attributes, *_names(kind.relations))


def _names(relations: tuple[Relation, ...]) -> tuple[str, ...]:
    return tuple(word for each in relations for one in each.landmarks for word in (one.name, *one.attributes))


def related(text: str, relations: tuple[Relation, ...]) -> str:
    """Appends relations to the text of an object or a place."""
    for number, relation in enumerate(relations):
        landmarks = " and ".join(map(landmark_text, relation.landmarks))
        text += f"{',' if number else ''} {relation.phrase} {landmarks}".rstrip()
    return text


def landmark_text(landmark: Landmark) -> str:
    """Text of a landmark; in quotes if it would not parse back to the same landmark."""
    plain, kind = str(landmark), ObjectKind(landmark.name, landmark.attributes)
    is_plain = " and " not in plain and not _has_relation(plain)
    is_plain = is_plain and re.match(r"the |[A-Z]", plain) is not None
    if is_plain and _parse_counted(plain.removeprefix("the ")) == (kind, 1):
        return plain
    return " ".join(("the", *landmark.attributes, f'"{landmark.name}"'))


def parse_landmark(text: str) -> Landmark:
    """Parses a landmark. Raises ValueError when the text is no single object or place."""
    kind, count = _parse_counted(text.removeprefix("the "))
    if kind is None or count != 1:
        raise ValueError(f"'{text}' is no single object or place")
    return Landmark(kind.name, kind.attributes)


def _has_relation(text: str) -> bool:
    return any(match.group(2) for match in _RELATION.finditer(f" {text}"))


def split_relations(text: str) -> tuple[str, tuple[Relation, ...]]:
    """Splits the text of an object or a place from its relations. Raises ValueError for wrong landmarks."""
    found = [match for match in _RELATION.finditer(text) if match.group(2)]
    ends = [*(match.start() for match in found), len(text)]
    relations = []
    for match, end in zip(found, ends[1:], strict=True):
        kind, said = RelationKind(match.group(2)), text[match.end() : end].strip()
        parts = re.split(r' and (?=(?:[^"]*"[^"]*")*[^"]*$)', said) if kind is RelationKind.BETWEEN else [said]
        landmarks = tuple(map(parse_landmark, parts)) if said else ()
        relations.append(Relation(kind, landmarks, int(match.group(1) or 1)))
    return text[: ends[0]], tuple(relations)


def _counted_text(of: ObjectKind | None, count: int) -> str:
    """Text between the brackets; in quotes if it would not parse back to the same object."""
    if of is None:
        return NOTHING
    number = {0: f"{_PLURAL} ", 1: ""}.get(count, f"{count} ")
    plain = f"{number}{' '.join((*of.attributes, of.name))}"
    parses = not _has_relation(plain) and plain[-1] != "," and _parse_counted(plain) == (of.plain, count)
    return related(plain if parses else f'{number}{" ".join((*of.attributes, ""))}"{of.name}"', of.relations)


def _parse_counted(text: str) -> tuple[ObjectKind | None, int]:
    if text == NOTHING:
        return None, 1
    words, relations = split_relations(text)
    match = _COUNTED.fullmatch(words)
    if match is None:
        raise ValueError(f"[{text}] is no object")
    number, attributes, quoted, plain = match.groups()
    count = 1 if number is None else 0 if number == _PLURAL else int(number)
    if quoted is not None:
        return ObjectKind(quoted, tuple((attributes or "").split()), relations), count
    return replace(parse_object(" ".join(filter(None, (attributes, plain)))), relations=relations), count


def _goal_text(command: Command) -> str:
    if command.goal is None:
        return NOTHING
    name, at = _quoted_place(command.goal), command.goal_at
    return related(name, command.goal_relations) if at is None else f"{name} at {_quoted_place(at)}"


def _quoted_place(name: str) -> str:
    is_plain = name != NOTHING and name[-1] != "," and " at " not in f" {name} " and not _has_relation(f"at {name}")
    return name if is_plain else f'"{name}"'


def _parse_goal(text: str) -> tuple[str | None, str | None]:
    match = _GOAL.fullmatch(text)
    if text == NOTHING or match is None:
        return None, None
    goal, goal_at = match.groups()
    return goal.strip('"'), goal_at.strip('"') if goal_at else None
