"""From a sentence to commands, or to one line that says why not."""

from __future__ import annotations

import enum
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

from executive.language.cleaning import clean, foreign_reason, placeholder, strip_wake
from executive.language.parser import DependencyParser
from executive.language.questions import Answerer, ClarifyingQuestion, RefusalError, RefusalKind, with_answer
from executive.language.reference import Memory
from executive.language.spelling import Corrected, WordFacts, correct_spelling
from executive.language.steps import Trace, trace_sentence
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import steps_of_commands
from executive.words.step import Step
from executive.words.yaml_steps import steps_to_data

if TYPE_CHECKING:
    from executive.language.clauses import Clause
    from executive.language.structure.sentence import Structured

__all__ = [
    "Status",
    "Understanding",
    "asked_until_clear",
    "meaning",
    "parse_lines",
    "spelled",
    "understand",
    "understand_asking",
]


class Status(enum.Enum):
    """How understanding a sentence ended."""

    OK = "ok"  # it became commands
    REFUSED = "refused"  # it, or a part of it, is nothing that the robot does
    QUESTION = "question"  # the speaker must say more
    NOT_ADDRESSED = "not_addressed"  # it was not for this robot


@dataclass(frozen=True)
class Understanding:
    """What a sentence means: commands when `status` is OK, else the reason in one line.

    `steps` is the whole mission where it decides, repeats, waits or the like, and empty otherwise.
    `question` is what the robot asks back, `notes` say which name was taken for which, `memory` is what was spoken of,
    `trace` how the answer came about.
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

    @property
    def all_steps(self) -> tuple[Step, ...]:
        """What it asks for as steps: those that decide, repeat or wait, else its commands."""
        return self.steps or steps_of_commands(self.commands)

    @property
    def refused_as(self) -> RefusalKind | None:
        """Why it became no commands; None where it did, or where it was not for this robot."""
        return None if self.trace is None or self.trace.refusal is None else self.trace.refusal.kind

    def to_json(self) -> dict[str, Any]:
        """The answer as JSON values."""
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
    """The commands that `sentence` asks for.

    Args:
        sentence: what was said or typed.
        parser: the dependency parser.
        knowledge: the world's names and defaults; None keeps all names as they were spoken.
        require_wake: whether a sentence without the wake phrase is not for this robot.
        robot_name: the name to listen to; by default the one in `knowledge`.
        memory: what was spoken of before, for "it" and "there".
        correct: whether misspelled names are taken for known ones where that is safe.
    """
    name = robot_name or (knowledge.robot.name if knowledge else "robot")
    wake = strip_wake(clean(sentence), name, knowledge.robot.others if knowledge else ())
    if wake.other_name is not None and knowledge is not None:
        reason = f"it is said to {wake.other_name}, and this robot is {name}"
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason, unknown_words=(wake.other_name,))
    if require_wake and not wake.addressed:
        reason = f'the robot\'s name was not said; begin with "Hey {name}"'
        return Understanding(sentence, Status.NOT_ADDRESSED, reason=reason)
    if (blank := placeholder(sentence)) is not None:
        odd = RefusalError(f"{blank!r} is no word; say it in words", [blank])
        trace = Trace(sentence, refusal=odd, refused_at="cleaning")
        return Understanding(sentence, Status.REFUSED, (), odd.reason, odd.unknown, trace=trace)
    corrected = spelled(wake.text, parser, knowledge) if correct else Corrected(wake.text)
    return meaning(sentence, corrected, parser=parser, knowledge=knowledge, memory=memory)


def spelled(text: str, parser: DependencyParser, knowledge: Knowledge | None) -> Corrected:
    """The text with the world's names in place of misspelled ones, where words can be judged."""
    if knowledge is None or not isinstance(parser, WordFacts):
        return Corrected(text)
    return correct_spelling(text, knowledge, parser)


def meaning(
    sentence: str,
    said: Corrected,
    *,
    parser: DependencyParser,
    knowledge: Knowledge | None,
    memory: Memory | None,
    clauses: Sequence[Clause] | None = None,
) -> Understanding:
    """What a text for one robot means, the text being `said` of the sentence; its clauses where they are known."""
    trace = trace_sentence(said.text, parser=parser, knowledge=knowledge, memory=memory)
    if knowledge is not None and _MENTIONED.search(said.text) is not None:
        trace = _with_structure(trace, said.text, clauses, parser, knowledge, memory)
    refusal, notes = trace.refusal, (*said.notes, *trace.notes)
    if refusal is None:
        found = Understanding(sentence, Status.OK, trace.commands, notes=notes, memory=trace.memory, trace=trace)
        return replace(found, steps=trace.steps)
    status = Status.QUESTION if refusal.question else Status.REFUSED
    reason = foreign_reason(said.text) or refusal.reason
    return Understanding(sentence, status, (), reason, refusal.unknown, refusal.question, notes, trace=trace)


def _with_structure(
    plain: Trace,
    text: str,
    clauses: Sequence[Clause] | None,
    parser: DependencyParser,
    knowledge: Knowledge,
    memory: Memory | None,
) -> Trace:
    """What a sentence that is no list of plain commands means, if it decides, repeats, waits, says or asks."""
    from executive.language.clauses import split
    from executive.language.structure.sentence import structured

    try:
        said, read = split(text).clauses if clauses is None else clauses, plain.refusal is None
        found = structured(said, parser=parser, knowledge=knowledge, memory=memory, plain=read)
    except RefusalError as refusal:
        return replace(plain, refusal=refusal, refused_at="structure")
    return plain if found is None else _traced(plain, found)


def _traced(plain: Trace, found: Structured) -> Trace:
    """The trace of the whole sentence, with what its parts became."""
    commands = tuple(command for step in found.steps for each in step.walk() for command in each.commands)
    trace = Trace(plain.text, plain.opened, plain.tokens, commands=commands, notes=found.notes, memory=found.memory)
    return replace(trace, parts=found.parts, steps=found.steps)


def parse_lines(
    lines: Iterable[str], *, parser: DependencyParser, knowledge: Knowledge | None, require_wake: bool = False
) -> Iterator[Understanding]:
    """Understand each line for itself, in order; an empty line is refused, not skipped."""
    for line in lines:
        yield understand(line.rstrip("\r\n"), parser=parser, knowledge=knowledge, require_wake=require_wake)


def understand_asking(
    sentence: str,
    *,
    answer: Answerer,
    parser: DependencyParser,
    knowledge: Knowledge,
    require_wake: bool,
    robot_name: str | None = None,
    correct: bool = True,
) -> Understanding:
    """What a sentence means once its questions are answered; `text` is the sentence with the answers in their places.

    The arguments are those of `understand`. A question that is left open, or whose answer is not understood, is what
    comes back.
    """

    def meant(text: str) -> Understanding:
        return understand(
            text, parser=parser, knowledge=knowledge, require_wake=require_wake, robot_name=robot_name, correct=correct
        )

    return asked_until_clear(sentence, meant, answer)


class _Asking(Protocol):
    @property
    def question(self) -> ClarifyingQuestion | None: ...


Meant = TypeVar("Meant", bound=_Asking)


def asked_until_clear(sentence: str, meant: Callable[[str], Meant], answer: Answerer) -> Meant:
    """What a sentence means with the answers to its questions in their places, at most three."""
    found = meant(sentence)
    for _ in range(_MOST_QUESTIONS):
        said = None if found.question is None else answer(found.question)
        if found.question is None or said is None:
            break
        sentence = with_answer(sentence, found.question, said)
        found = meant(sentence)
    return found


_MOST_QUESTIONS: Final = 3
_MENTIONED: Final = re.compile(
    r"\b(?:is it|are you|house|whole|everywhere|all over|move|if|unless|in case|otherwise|else|every|each|all"
    r"|everyone|everybody|twice|times|once|while|as long as|until"
    r"|till|soon|when|wait|stay|say|tell|announce|ask|greet|know|inform|remind|whatever|matter|regardless|failing|fail"
    r"|fails|door|battery|charge|percent|repeat|holding|report|provided)\b",
    re.IGNORECASE,
)
"""Where none of this is said, it is a sentence of plain commands, and the rest of the language is not loaded."""
