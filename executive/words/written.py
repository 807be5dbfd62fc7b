"""The written form of a mission's steps: one line for each, which reads back to the same step.

A step of commands is those with "then" between them; a block is a word for what it does, with the steps that it holds
in braces and ";" between them:

    If (Take [Nothing] to [kitchen] and do [find] to [beer]) {Take [beer] to [hall] and do [Nothing] to [Nothing]}

Names and texts stand in quotes as in JSON, times in seconds. What only a mission file can say (policies, skills, used
missions) has no written form.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

from executive.words.blocks import (
    Ask,
    Block,
    Check,
    Choose,
    Dock,
    Group,
    Handler,
    Repeat,
    Set,
    Speak,
    Together,
    Try,
    Wait,
)
from executive.words.command import Command, parse_command
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Condition, DoorOpen, Look, Not, ValueIs
from executive.words.expression import Expression, ExpressionError, Template
from executive.words.steps import MissionStep

__all__ = ["parse_written", "written", "written_condition"]

Steps = tuple[MissionStep, ...]


def written(steps: Iterable[MissionStep]) -> tuple[str, ...]:
    """The steps, a line for each. Raises ValueError: a step that only a mission file can say."""
    return tuple(map(_written_step, steps))


def written_condition(condition: Condition) -> str:
    """The condition, as it stands in brackets behind "If"."""
    match condition:
        case ValueIs(expression):
            return f"value {_quoted(expression.text)}"
        case Look(command, max_age_s):
            return f"{command}{_aged(max_age_s)}"
        case DoorOpen((one, other), max_age_s):
            return f"door {_quoted(one)} - {_quoted(other)} open{_aged(max_age_s)}"
        case ButtonPressed(name):
            return f"button {_quoted(name)} pressed"
        case AllOf(parts):
            return f"all({', '.join(map(written_condition, parts))})"
        case AnyOf(parts):
            return f"any({', '.join(map(written_condition, parts))})"
        case Not(part):
            return f"not({written_condition(part)})"


def _aged(max_age_s: float) -> str:
    """How old an answer may be, where it may be old at all."""
    return f" aged {_number(max_age_s)} s" if max_age_s else ""


def parse_written(lines: Iterable[str]) -> Steps:
    """The steps that `written` wrote; a command's `verb` is not part of the form. Raises ValueError."""
    reader = _Reader("\n".join(lines))
    try:
        steps = reader.steps()
    except (ExpressionError, json.JSONDecodeError) as error:
        raise reader.error(str(error)) from error
    if not reader.ended:
        raise reader.error("here no step begins")
    return steps


def _written_step(step: MissionStep) -> str:
    plain = MissionStep(tuple(replace(command, verb="") for command in step.commands), step.source, block=step.block)
    bare = replace(step, commands=plain.commands)
    if bare != plain or (step.block is None) != bool(step.commands):
        raise ValueError("a step that only a mission file can say has no written form")
    return _written_block(step.block) if step.block is not None else " then ".join(map(str, step.commands))


def _written_block(block: Block) -> str:
    match block:
        case Choose(condition, then, otherwise):
            return f"If ({written_condition(condition)}) {_braced(then)}{_branch('Otherwise', otherwise)}"
        case Repeat():
            return f"Repeat{_rounds(block)} {_braced(block.steps)}"
        case Try(steps, otherwise):
            return f"Try {_braced(steps)} Otherwise {_braced(otherwise)}"
        case Together(steps, needed):
            return f"Together{'' if needed is None else f' {needed} needed'} {_braced(steps)}"
        case Group():
            return _written_group(block)
        case Wait():
            return f"Wait{_awaited(block)}"
        case Check(condition, gives):
            return f"Check ({written_condition(condition)}){_named(gives)}"
        case Dock(level):
            return "Dock" if level is None else f"Dock to {_number(level)}"
        case Speak(text):
            return f"Say {_quoted(text.text)}"
        case Ask():
            return _written_ask(block)
        case Set(values):
            return f"Set {', '.join(f'{_quoted(name)} = {_quoted(each.text)}' for name, each in values.items())}"


def _rounds(block: Repeat) -> str:
    times = "" if block.times is None else f" {block.times} times"
    every = "" if block.every_s is None else f" every {_number(block.every_s)} s"
    while_ = "" if block.while_ is None else f" while ({written_condition(block.while_)})"
    until = "" if block.until is None else f" until ({written_condition(block.until)})"
    return f"{times}{every}{while_}{until}"


def _written_group(block: Group) -> str:
    name = "" if block.name is None else f" {_quoted(block.name)}"
    holds = "" if block.holds is None else f" holds ({written_condition(block.holds)})"
    when = "".join(
        f" When ({written_condition(each.condition)}) {each.times} times {_braced(each.steps)}" for each in block.when
    )
    return f"Group{name}{holds} {_braced(block.steps)}{when}{_branch('Finally', block.always)}"


def _awaited(block: Wait) -> str:
    condition = "" if block.condition is None else f" for ({written_condition(block.condition)})"
    seconds = "" if block.seconds is None else f" {_number(block.seconds)} s"
    clock = "" if block.until_clock_s is None else f" until {_number(block.until_clock_s)} s"
    every = "" if block.every_s == Wait().every_s else f" every {_number(block.every_s)} s"
    return f"{condition}{seconds}{clock}{every}"


def _written_ask(block: Ask) -> str:
    match = "" if block.match is None else f" for {_quoted(block.match)}"
    limit = "" if block.limit_s == Ask(block.text).limit_s else f" within {_number(block.limit_s)} s"
    default = "" if block.default is None else f" else {json.dumps(block.default)}"
    choices = "; ".join(f"{_quoted(choice)} {_braced(steps)}" for choice, steps in block.choices.items())
    return f"Ask {_quoted(block.text.text)}{match}{limit}{default}{_named(block.gives)} {{{choices}}}"


def _braced(steps: Steps) -> str:
    return f"{{{'; '.join(map(_written_step, steps))}}}"


def _branch(word: str, steps: Steps) -> str:
    return f" {word} {_braced(steps)}" if steps else ""


def _named(gives: str | None) -> str:
    return "" if gives is None else f" as {_quoted(gives)}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _number(value: float) -> str:
    short = f"{value:g}"
    return short if float(short) == value else repr(float(value))


_COMMAND: Final = re.compile(r"Take \[[^\]]+\] to \[[^\]]+\] and do \[[^\]]+\] to \[[^\]]+\]")
_STRING: Final = re.compile(r'"(?:[^"\\]|\\.)*"')
_VALUE: Final = re.compile(r'"(?:[^"\\]|\\.)*"|true|false|-?\d+(?:\.\d+)?(?:e[-+]?\d+)?')
_NUMBER: Final = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_DIGITS: Final = re.compile(r"\d+")
_WORD: Final = re.compile(r"[A-Za-z]+")
_BLANK: Final = re.compile(r"\s*")
_END: Final = re.compile(r"[;\s]*")


class _Reader:
    """Reads the form from left to right; all methods raise ValueError."""

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self.steps_end()

    @property
    def ended(self) -> bool:
        """Whether nothing is left."""
        return self._at == len(self._text)

    def error(self, message: str) -> ValueError:
        """What is wrong, and where."""
        return ValueError(f"{message}: {self._text[self._at : self._at + 40]!r}")

    def steps_end(self) -> None:
        """Pass over what stands between steps."""
        end = _END.match(self._text, self._at)
        self._at = self._at if end is None else end.end()

    def found(self, pattern: re.Pattern[str]) -> str | None:
        """What stands here, if it fits; it is read then, and the blanks behind it."""
        match = pattern.match(self._text, self._at)
        if match is None:
            return None
        blank = _BLANK.match(self._text, match.end())
        self._at = match.end() if blank is None else blank.end()
        return match[0]

    def sign(self, sign: str) -> bool:
        """Whether `sign` stands here; it is read then."""
        return self.found(re.compile(re.escape(sign))) is not None

    def word(self, word: str) -> bool:
        """Whether `word` stands here; it is read then."""
        return self.found(re.compile(rf"{word}\b")) is not None

    def want(self, sign: str) -> None:
        """Read a sign that must stand here."""
        if not self.sign(sign):
            raise self.error(f"here {sign!r} is missing")

    def string(self) -> str:
        """A text in quotes."""
        text: str = json.loads(self._must(_STRING, "a text in quotes"))
        return text

    def number(self) -> float:
        """A number."""
        return float(self._must(_NUMBER, "a number"))

    def count(self, word: str) -> int | None:
        """A whole number with `word` behind it, if one stands here."""
        digits = self.found(_DIGITS)
        if digits is not None:
            self.want(word)
        return None if digits is None else int(digits)

    def seconds(self) -> float:
        """A number with "s" behind it."""
        number = self.number()
        self.want("s")
        return number

    def _must(self, pattern: re.Pattern[str], what: str) -> str:
        found = self.found(pattern)
        if found is None:
            raise self.error(f"here {what} is missing")
        return found

    def steps(self) -> Steps:
        """Steps up to a closing brace or the end."""
        found: list[MissionStep] = []
        self.steps_end()
        while not self.ended and not self._text.startswith("}", self._at):
            found.append(self.step())
            self.steps_end()
        return tuple(found)

    def braced(self) -> Steps:
        """Steps in braces."""
        self.want("{")
        steps = self.steps()
        self.want("}")
        return steps

    def branch(self, word: str) -> Steps:
        """Steps in braces behind a word, or none."""
        return self.braced() if self.word(word) else ()

    def step(self) -> MissionStep:
        """One step."""
        if (first := self.command()) is not None:
            commands = [first]
            while self.word("then"):
                if (another := self.command()) is None:
                    raise self.error("here a command is missing")
                commands.append(another)
            return MissionStep(tuple(commands))
        begun = self._at
        read = _BLOCKS.get(self.found(_WORD) or "")
        if read is None:
            self._at = begun
            raise self.error("here no step begins")
        return MissionStep(block=read(self))

    def command(self) -> Command | None:
        """A command in its text form, if one stands here."""
        text = self.found(_COMMAND)
        return None if text is None else parse_command(text)

    def bracketed(self) -> Condition:
        """A condition in brackets."""
        self.want("(")
        condition = self.condition()
        self.want(")")
        return condition

    def condition(self) -> Condition:
        """A condition."""
        if (command := self.command()) is not None:
            return Look(command, self._age())
        if self.word("value"):
            return ValueIs(Expression(self.string()))
        if self.word("door"):
            return self._door()
        if self.word("button"):
            name = self.string()
            self.want("pressed")
            return ButtonPressed(name)
        if self.word("not"):
            return Not(self.bracketed())
        for word, kind in _JOINED.items():
            if self.word(word):
                return kind(self._parts())
        raise self.error("here a condition is missing")

    def _door(self) -> DoorOpen:
        one = self.string()
        self.want("-")
        other = self.string()
        self.want("open")
        return DoorOpen((one, other), self._age())

    def _age(self) -> float:
        """How old an answer may be, where that is said."""
        return self.seconds() if self.word("aged") else 0.0

    def _parts(self) -> tuple[Condition, ...]:
        self.want("(")
        parts: list[Condition] = []
        while not self.sign(")"):
            parts.append(self.condition())
            self.sign(",")
        return tuple(parts)

    def value(self) -> Any:
        """A plain value."""
        return json.loads(self._must(_VALUE, "a value"))


def _choose(reader: _Reader) -> Block:
    return Choose(reader.bracketed(), reader.braced(), reader.branch("Otherwise"))


def _repeat(reader: _Reader) -> Block:
    times = reader.count("times")
    every_s = reader.seconds() if reader.word("every") else None
    while_ = reader.bracketed() if reader.word("while") else None
    until = reader.bracketed() if reader.word("until") else None
    return Repeat(reader.braced(), times, until, while_, every_s)


def _try(reader: _Reader) -> Block:
    return Try(reader.braced(), reader.branch("Otherwise"))


def _together(reader: _Reader) -> Block:
    needed = reader.count("needed")
    return Together(reader.braced(), needed)


def _group(reader: _Reader) -> Block:
    named = reader.found(_STRING)
    holds = reader.bracketed() if reader.word("holds") else None
    steps = reader.braced()
    when: list[Handler] = []
    while reader.word("When"):
        condition, times = reader.bracketed(), reader.count("times")
        when.append(Handler(condition, reader.braced(), times or 0))
    name = None if named is None else json.loads(named)
    return Group(steps, name, reader.branch("Finally"), holds, tuple(when))


def _wait(reader: _Reader) -> Block:
    condition = seconds = clock = None
    if reader.word("for"):
        condition = reader.bracketed()
    elif reader.word("until"):
        clock = reader.seconds()
    else:
        seconds = reader.seconds()
    every_s = reader.seconds() if reader.word("every") else Wait().every_s
    return Wait(condition, seconds, clock, every_s)


def _check(reader: _Reader) -> Block:
    return Check(reader.bracketed(), _name(reader))


def _dock(reader: _Reader) -> Block:
    return Dock(reader.number() if reader.word("to") else None)


def _say(reader: _Reader) -> Block:
    return Speak(Template(reader.string()))


def _ask(reader: _Reader) -> Block:
    text = Template(reader.string())
    match = reader.string() if reader.word("for") else None
    limit_s = reader.seconds() if reader.word("within") else Ask(text).limit_s
    default = reader.value() if reader.word("else") else None
    gives = _name(reader)
    reader.want("{")
    choices: dict[str, Steps] = {}
    while not reader.sign("}"):
        choice = reader.string()
        choices[choice] = reader.braced()
        reader.sign(";")
    return Ask(text, choices, match, limit_s, default, gives)


def _set(reader: _Reader) -> Block:
    values: dict[str, Expression] = {}
    while True:
        name = reader.string()
        reader.want("=")
        values[name] = Expression(reader.string())
        if not reader.sign(","):
            return Set(values)


def _name(reader: _Reader) -> str | None:
    return reader.string() if reader.word("as") else None


_JOINED: Final[Mapping[str, Callable[[tuple[Condition, ...]], Condition]]] = {"all": AllOf, "any": AnyOf}
_BLOCKS: Final[Mapping[str, Callable[[_Reader], Block]]] = MappingProxyType(
    {
        "If": _choose,
        "Repeat": _repeat,
        "Try": _try,
        "Together": _together,
        "Group": _group,
        "Wait": _wait,
        "Check": _check,
        "Dock": _dock,
        "Say": _say,
        "Ask": _ask,
        "Set": _set,
    }
)
"""How the blocks are read, by their first words."""
