"""The steps from a cleaned sentence to its commands, and the trace that they leave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.actions import Action, read_actions
from executive.language.cleaning import MAX_CHARACTERS, MAX_WORDS, rephrased
from executive.language.command_frames import CommandFrame, command_frames, spoken_command
from executive.language.disfluency import repair_disfluencies, unwanted_things
from executive.language.grounding import check_unwanted, ground_noted
from executive.language.items import Being, Item, Predicate, predicates, without_name
from executive.language.lexicon import VerbKind, lexicon
from executive.language.limits import check_feasible, check_ways_and_speaker, not_understood, refuse_harm
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase, noun_phrases
from executive.language.questions import ABLE, RefusalError, RefusalKind, Slot, which
from executive.language.reading import split_items
from executive.language.reference import Memory, ResolvedAction, resolve
from executive.language.roles import Location
from executive.language.spelling import WordFacts
from executive.language.tokens import Affirmed, Token, affirmed, name_table, parse_with_names
from executive.words.command import Command, is_attribute
from executive.words.knowledge import Knowledge
from executive.words.step import Step
from skills.files.errors import listing

__all__ = ["Part", "Steps", "Trace", "trace_sentence"]


@dataclass(frozen=True)
class Trace:
    """What each step made of a sentence, in the order of the fields; steps behind a refusal are empty.

    `unwanted` is what stands behind "not", `meanings` are pronouns with what each stood for, `notes` say which name was
    taken for which. `refused_at` names the step that refused. `memory` is what was spoken of before, and afterwards
    what was spoken of last. `steps` is the mission of a sentence that decides, repeats, waits or the like, and `parts`
    are its clauses. `affirmed` is a statement that is checked, without its negation.
    """

    text: str
    opened: str = ""
    tokens: tuple[Token, ...] = ()
    items: tuple[Item, ...] = ()
    unwanted: tuple[Phrase, ...] = ()
    clauses: tuple[Predicate, ...] = ()
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
    steps: tuple[Step, ...] = ()
    affirmed: Affirmed | None = None


@dataclass(frozen=True)
class Part:
    """What is known of a part of a sentence before it is read.

    `lead` are items that stand before its words. `asked` says that it is a statement to be checked, `elliptic` that it
    may leave out "it". `recipient` is who is given things where it does not say to whom.
    """

    lead: tuple[Item, ...] = ()
    asked: bool = False
    elliptic: bool = False
    recipient: Location | None = None


@dataclass(frozen=True)
class Steps:
    """The steps from words to commands in one world; with `knowledge` None all names stay as they were spoken."""

    parser: DependencyParser
    knowledge: Knowledge | None

    def trace(
        self, text: str, memory: Memory | None = None, part: Part | None = None, *, upto: str | None = None
    ) -> Trace:
        """All steps, or those up to one by its name, from text without wake phrase; never raises on text.

        `memory` is what earlier sentences spoke of.
        """
        names = tuple(_STEPS)
        first = names if upto is None else names[: names.index(upto) + 1]
        return self._run(Trace(text, memory=memory or Memory()), first, part or Part())

    def rest(self, trace: Trace, *, behind: str) -> Trace:
        """The steps behind one, from what that has made; never raises."""
        names = tuple(_STEPS)
        return self._run(trace, names[names.index(behind) + 1 :], Part())

    def _run(self, trace: Trace, names: Sequence[str], part: Part) -> Trace:
        context = _Context(self.parser, self.knowledge, part)
        for name in names:
            try:
                trace = _STEPS[name](trace, context)
            except RefusalError as refusal:
                return replace(trace, refusal=refusal, refused_at=name)
        return trace


@dataclass(frozen=True)
class _Context:
    parser: DependencyParser
    knowledge: Knowledge | None
    part: Part


def trace_sentence(
    text: str, *, parser: DependencyParser, knowledge: Knowledge | None, memory: Memory | None = None
) -> Trace:
    """All steps of a whole sentence; see `Steps`."""
    return Steps(parser, knowledge).trace(text, memory)


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


def _read(trace: Trace, context: _Context) -> Trace:
    part = context.part
    there = any(isinstance(item, Being) and item.existential for item in part.lead)
    said = affirmed(trace.tokens, there=there) if part.asked else Affirmed(trace.tokens)
    trace = replace(trace, tokens=said.tokens, affirmed=said)
    phrases = noun_phrases(trace.tokens)
    items = split_items(trace.tokens, phrases, lexicon(), lead=part.lead, silent=said.silent)
    return replace(trace, items=repair_disfluencies(items), unwanted=unwanted_things(items))


def _split(trace: Trace, context: _Context) -> Trace:
    clauses = predicates(trace.items)
    if not clauses:
        raise RefusalError(f"nothing was said; {ABLE}")
    refuse_harm(clauses)
    return replace(trace, clauses=clauses if context.knowledge else without_name(clauses))


def _act(trace: Trace, context: _Context) -> Trace:
    told = context.part.elliptic and bool(trace.memory.things)
    recipient = context.part.recipient
    return replace(trace, actions=read_actions(trace.clauses, lexicon(), told=told, recipient=recipient))


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
