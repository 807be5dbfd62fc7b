"""The steps from a cleaned sentence to its commands, and the trace that they leave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.actions import Action, read_actions
from executive.language.clauses import Clause, split_clauses, without_name
from executive.language.cleaning import MAX_CHARACTERS, MAX_WORDS, rephrased
from executive.language.command_frames import CommandFrame, command_frames, spoken_command
from executive.language.disfluency import repair_disfluencies, unwanted_things
from executive.language.grounding import check_unwanted, ground_noted
from executive.language.items import Item
from executive.language.lexicon import VerbKind, lexicon
from executive.language.limits import check_feasible, check_ways_and_speaker, not_understood, refuse_harm
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase, noun_phrases
from executive.language.questions import ABLE, RefusalError, RefusalKind, Slot, which
from executive.language.reading import split_items
from executive.language.reference import Memory, ResolvedAction, resolve
from executive.language.spelling import WordFacts
from executive.language.tokens import Token, name_table, parse_with_names
from executive.words.command import Command, is_attribute
from executive.words.knowledge import Knowledge
from executive.words.steps import MissionStep
from skills.files.errors import listing

__all__ = ["Trace", "trace_sentence"]


@dataclass(frozen=True)
class Trace:
    """What each step made of a sentence, in the order of the fields; steps behind a refusal are empty.

    `unwanted` is what stands behind "not", `meanings` are pronouns with what each stood for, `notes` say which name was
    taken for which. `refused_at` names the step that refused. `memory` is what was spoken of before, and afterwards
    what was spoken of last. `steps` is the mission of a sentence that decides, repeats, waits or the like, and `parts`
    are its clauses.
    """

    text: str
    opened: str = ""
    tokens: tuple[Token, ...] = ()
    items: tuple[Item, ...] = ()
    unwanted: tuple[Phrase, ...] = ()
    clauses: tuple[Clause, ...] = ()
    actions: tuple[Action, ...] = ()
    resolved: tuple[ResolvedAction, ...] = ()
    frames: tuple[CommandFrame, ...] = ()
    meanings: tuple[tuple[str, str], ...] = ()
    commands: tuple[Command, ...] = ()
    notes: tuple[str, ...] = ()
    refusal: RefusalError | None = None
    refused_at: str | None = None
    memory: Memory = field(default_factory=Memory)
    parts: tuple[str, ...] = ()
    steps: tuple[MissionStep, ...] = ()


@dataclass(frozen=True)
class _Context:
    parser: DependencyParser
    knowledge: Knowledge | None


def trace_sentence(
    text: str, *, parser: DependencyParser, knowledge: Knowledge | None, memory: Memory | None = None
) -> Trace:
    """All steps from text, without wake phrase, to commands; never raises on text.

    With `knowledge` None all names stay as they were spoken. `memory` is what earlier sentences spoke of.
    """
    trace, context = Trace(text, memory=memory or Memory()), _Context(parser, knowledge)
    for name, step in _STEPS.items():
        try:
            trace = step(trace, context)
        except RefusalError as refusal:
            return replace(trace, refusal=refusal, refused_at=name)
    return trace


def _open(trace: Trace, _: _Context) -> Trace:
    words = trace.text.split()
    if len(words) > MAX_WORDS:
        raise RefusalError(f"{len(words)} words are too many for one sentence; say it in {MAX_WORDS} at most")
    if len(trace.text) > MAX_CHARACTERS:
        raise RefusalError(f"{len(trace.text)} characters are too many for one sentence; {MAX_CHARACTERS} at most")
    return replace(trace, opened=rephrased(trace.text))


def _parse(trace: Trace, context: _Context) -> Trace:
    table = None if context.knowledge is None else name_table(context.knowledge)
    return replace(trace, tokens=parse_with_names(trace.opened, context.parser.parse, table))


def _read(trace: Trace, _: _Context) -> Trace:
    items = split_items(trace.tokens, noun_phrases(trace.tokens), lexicon())
    return replace(trace, items=repair_disfluencies(items), unwanted=unwanted_things(items))


def _split(trace: Trace, context: _Context) -> Trace:
    clauses = split_clauses(trace.items)
    if not clauses:
        raise RefusalError(f"nothing was said; {ABLE}")
    refuse_harm(clauses)
    return replace(trace, clauses=clauses if context.knowledge else without_name(clauses))


def _act(trace: Trace, _: _Context) -> Trace:
    return replace(trace, actions=read_actions(trace.clauses, lexicon()))


def _check(trace: Trace, context: _Context) -> Trace:
    """Refuse the whole sentence when any part of it was not understood."""
    unknown = [(word, action.said) for action in trace.actions for word in action.unknown]
    if unknown:
        raise not_understood(unknown, context.knowledge)
    asked = [(choice, action.kind) for action in trace.actions for choice in action.choices]
    choices = [choice for choice, _ in asked]
    for choice, kind in asked:
        if kind is VerbKind.FIND or not _any_will_do(choice):
            raise _choosing(choice, trace.tokens)
    notes = [f"of {listing((p.spoken for p in choice), last='or')} I take the first" for choice in choices]
    trace = replace(trace, notes=(*trace.notes, *notes))
    if context.knowledge is not None:
        check_ways_and_speaker(trace.clauses, trace.actions)
    if not any(action.kind for action in trace.actions):
        told = [phrase.text for action in trace.actions for phrase in action.objects]
        of = f" of {listing(told)}" if told else ""
        raise RefusalError(f"nothing to do was said{of}; {ABLE}", told, kind=RefusalKind.NOTHING_TO_DO)
    return trace


def _any_will_do(choice: Sequence[Phrase]) -> bool:
    """Whether the speaker would take any one of them: "an apple or an orange"."""
    return all(phrase.tokens[0].word in ("a", "an", "any", "some") and not phrase.person for phrase in choice)


def _choosing(choice: Sequence[Phrase], tokens: Sequence[Token]) -> RefusalError:
    """The question which of several is meant, where only one can be."""
    heard = " ".join(t.text for t in tokens[choice[0].content[0].index : choice[-1].head.index + 1]).replace(" ,", ",")
    place = all(phrase.kind is NounKind.PLACE for phrase in choice)
    slot = Slot.PLACE if place else Slot.PERSON if all(phrase.person for phrase in choice) else Slot.THING
    noun = choice[-1].head.text
    names = (f"{p.text} {noun}" if is_attribute(p.head.text) else p.text for p in choice)
    question = which(slot, slot.value, tuple(dict.fromkeys(names)))
    return RefusalError(question.text, (heard,), question=replace(question, heard=heard))


def _refer(trace: Trace, context: _Context) -> Trace:
    found = resolve(trace.actions, trace.memory)
    return replace(trace, resolved=found.actions, memory=found.memory, meanings=found.meanings)


def _check_feasible(trace: Trace, context: _Context) -> Trace:
    check_feasible(trace.resolved, context.knowledge)
    return trace


def _frame(trace: Trace, _: _Context) -> Trace:
    return replace(trace, frames=command_frames(trace.resolved))


def _command(trace: Trace, context: _Context) -> Trace:
    if context.knowledge is None:
        return replace(trace, commands=tuple(map(spoken_command, trace.frames)))
    facts = context.parser if isinstance(context.parser, WordFacts) else None
    grounded = ground_noted(trace.frames, context.knowledge, facts)
    check_unwanted(trace.unwanted, grounded.commands, context.knowledge)
    return replace(trace, commands=grounded.commands, notes=(*trace.notes, *grounded.notes))


_STEPS: Final[dict[str, Callable[[Trace, _Context], Trace]]] = {
    "cleaning": _open,
    "parsing": _parse,
    "reading": _read,
    "clauses": _split,
    "actions": _act,
    "understanding": _check,
    "reference": _refer,
    "feasibility": _check_feasible,
    "command frames": _frame,
    "grounding": _command,
}
