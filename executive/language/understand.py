"""Understands a sentence: its commands, or the reason for a refusal in one line."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING, Any, Final

from executive.language.cleaning import clean, foreign_reason, placeholder, strip_wake, unkept_reason
from executive.language.lexicon import unquoted
from executive.language.parser import DependencyParser
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import Answerer, ClarifyingQuestion, RefusalError, RefusalKind, insert_answer
from executive.language.reference import Memory
from executive.language.spelling import CorrectedText, correct_spelling
from executive.language.zone_rules import RoomRules, read_rules
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import steps_of_commands
from executive.words.second_look import second_look
from executive.words.step import Step
from executive.words.steps import steps_to_data, steps_to_yaml
from skills.inputs.errors import requote

if TYPE_CHECKING:
    from executive.language.addressees import RobotChoice
    from executive.language.clauses import Clause


class Status(enum.Enum):
    """Result of understanding a sentence."""

    OK = "ok"  # it became commands
    REFUSED = "refused"  # it, or a part of it, is nothing that the robot does
    QUESTION = "question"  # the speaker must say more
    NOT_ADDRESSED = "not_addressed"  # it was not for this robot


@dataclass(frozen=True)
class Understanding:
    """Meaning of a sentence: commands when `status` is OK, otherwise the reason in one line.

    `steps` is the whole mission of a sentence with conditions, loops or waits, and empty otherwise. `parts` assign it
    to robots by name; with several robots `commands` and `steps` are empty. `question` is the robot's question, `notes`
    list names that were interpreted as others, `memory` has the referents for the next sentence, `trace` has the result
    of each step. `addressed` is True if the sentence calls a robot by its name.
    """

    text: str
    status: Status
    commands: tuple[Command, ...] = ()
    reason: str | None = None
    unknown_words: tuple[str, ...] = ()
    question: ClarifyingQuestion | None = None
    notes: tuple[str, ...] = ()
    memory: Memory | None = None
    trace: Trace | None = field(default=None, compare=False, repr=False)
    steps: tuple[Step, ...] = ()
    parts: tuple[Part, ...] = ()
    addressed: bool = field(default=False, compare=False)

    @property
    def all_steps(self) -> tuple[Step, ...]:
        """Steps of the sentence; if it has no blocks, one step for each command."""
        return self.steps or steps_of_commands(self.commands)

    @property
    def refused_as(self) -> RefusalKind | None:
        """Kind of the refusal; None if there is no refusal, or the sentence is for another robot."""
        return None if self.trace is None or self.trace.refusal is None else self.trace.refusal.kind

    def __str__(self) -> str:
        """Returns the commands, one a line, or the reason why there are none."""
        meant = steps_to_yaml(self.steps) or map(str, self.commands)
        return "\n".join([*meant, *self.notes, *filter(None, [self.reason])])

    def _repr_html_(self) -> str:
        """Returns the same lines for a notebook."""
        return "".join(f"<p>{escape(line)}</p>" for line in str(self).splitlines())

    def to_json(self) -> dict[str, Any]:
        """Returns the answer as JSON values."""
        return {
            "text": self.text,
            "status": self.status.value,
            "reason": self.reason,
            "unknown_words": list(self.unknown_words),
            "question": None if self.question is None else self.question.to_json(),
            "notes": list(self.notes),
            "commands": [command.to_json() for command in self.commands],
            "mission": steps_to_data(self.steps),
        }


@dataclass(frozen=True)
class Part:
    """Part for one robot, for each (`RobotChoice.ALL`), or for any (`RobotChoice.ANY`).

    The part begins once the parts `after` (numbered from 0) are done. "Me" and "here" mean the start of the robot
    `speaker_by`; None: the world's start.
    """

    robot: str | RobotChoice
    meaning: Understanding
    after: tuple[int, ...] = ()
    speaker_by: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns the part as JSON values."""
        return {
            "robot": self.robot if isinstance(self.robot, str) else self.robot.value,
            "after": list(self.after),
            "speaker_by": self.speaker_by,
            "meaning": self.meaning.to_json(),
        }


def understand(
    sentence: str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge | None,
    require_wake: bool,
    robot_name: str | None = None,
    memory: Memory | None = None,
    correct: bool = True,
) -> Understanding:
    """Understands the commands in `sentence`, spoken or typed.

    With `knowledge` None, all names stay as spoken. With `require_wake` the sentence must begin with the wake phrase,
    which calls `robot_name` (by default the name in `knowledge`). `memory` has the referents of earlier sentences, for
    "it" and "there". With `correct`, misspelled names are corrected when that is safe.
    """
    name = robot_name or (knowledge.robot.name if knowledge else "robot")
    text = clean(sentence) if knowledge else unquoted(clean(sentence))
    called = strip_wake(text, name, knowledge.robot.others if knowledge else ())
    addressed = called.name == name
    if called.name not in (None, name) and knowledge is not None:
        reason = f"it is said to {called.name}, and this robot is {name}"
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason, unknown_words=(called.name or "",))
    if require_wake and not addressed:
        reason = f'the robot\'s name was not said; begin with "Hey {name}"'
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason)
    if (blank := _blank(sentence, knowledge)) is not None:
        odd = RefusalError(f"{blank!r} is no word; say it in words", [blank])
        return replace(_of_trace(Trace(sentence, refusal=odd, refused_at="cleaning")), addressed=addressed)
    said = correct_spelling(called.text, knowledge, parser) if correct and knowledge else CorrectedText(called.text)
    try:
        rules = read_rules(said.text, knowledge)
        found = under_rules(rules, meaning(Trace(rules.rest, memory or Memory()), Pipeline(parser, rules.knowledge)))
    except RefusalError as refusal:
        found = _of_trace(Trace(said.text, refusal=refusal, refused_at="rules"))
    found = look_again(said.text, found, knowledge)
    return replace(found, text=sentence, notes=(*said.notes, *found.notes), addressed=addressed)


def _blank(sentence: str, knowledge: Knowledge | None) -> str | None:
    """Placeholder in a sentence that is in no name of the world."""
    names = () if knowledge is None else (*knowledge.place_names(), *knowledge.object_names(), *knowledge.people)
    blank = placeholder(sentence)
    return None if blank is None or any(blank in each for each in names) else blank


def look_again(text: str, found: Understanding, knowledge: Knowledge | None) -> Understanding:
    """Refuses what a second look finds to lack a word that forbids, limits or shares."""
    if found.status is not Status.OK or knowledge is None:
        return found
    steps = [step for meant in (found, *(part.meaning for part in found.parts)) for step in meant.all_steps]
    word = second_look(text, steps, knowledge, robots=bool(found.parts))
    refusal = RefusalError(f"I cannot follow '{word}' in this sentence; say only what I am to do", [word or ""])
    return found if word is None else _of_trace(Trace(text, refusal=refusal, refused_at="second look"))


def under_rules(rules: RoomRules, meant: Understanding) -> Understanding:
    """Puts the steps, or those of each part, under the rules. Raises RefusalError for work in a forbidden room."""
    if meant.status is not Status.OK or not rules.zones:
        return meant
    if meant.parts:
        parts = tuple(replace(part, meaning=under_rules(rules, part.meaning)) for part in meant.parts)
        return replace(meant, parts=parts)
    return replace(meant, steps=(rules.around(meant.all_steps),), notes=(*meant.notes, *rules.notes))


def meaning(said: Trace, pipeline: Pipeline, clauses: Sequence[Clause] | None = None) -> Understanding:
    """Understands a text for one robot; takes an empty trace with the inputs, and optionally the text's clauses."""
    trace = pipeline.run(said)
    if pipeline.knowledge is not None and (trace.refusal is not None or trace.taken_back):
        from executive.language.structure.sentence import read_structure  # plain commands do not need it

        trace = read_structure(trace, clauses, pipeline, said.memory)
    return _of_trace(trace)


def _of_trace(trace: Trace) -> Understanding:
    refusal, text = trace.refusal, unquoted(trace.text)
    found = Understanding(text, Status.OK, notes=tuple(map(unquoted, trace.notes)), trace=trace)
    if refusal is None:
        return replace(found, commands=trace.commands, memory=trace.memory, steps=trace.steps)
    unkept = unkept_reason(text, " ".join((*refusal.unknown, (refusal.question and refusal.question.heard) or "")))
    question = refusal.question if unkept is None else None
    status = Status.QUESTION if question else Status.REFUSED
    reason = unkept or foreign_reason(text) or refusal.reason
    reason = reason if question or unkept else requote(reason, text)
    return replace(found, status=status, reason=reason, unknown_words=refusal.unknown, question=question)


def ask_until_clear(sentence: str, meant: Callable[[str], Understanding], answer: Answerer) -> Understanding:
    """Understands a sentence, and inserts the answers to at most three questions, also into the result's `text`.

    The result is a question if there is no answer, or if an answer is not understood.
    """
    found = meant(sentence)
    for _ in range(_MOST_QUESTIONS):
        if found.question is None or (said := answer(found.question)) is None:
            break
        sentence = insert_answer(sentence, found.question, said)
        found = meant(sentence)
    return found


_MOST_QUESTIONS: Final = 3
