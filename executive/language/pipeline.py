"""Pipeline from a cleaned sentence to its commands, with a trace of the steps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.actions import Action, read_actions
from executive.language.command_frames import CommandFrame, command_frames, spoken_command
from executive.language.coverage import cover, left_out
from executive.language.disfluency import repair_disfluencies, unwanted_phrases
from executive.language.grounding import ground, leave_out
from executive.language.items import Item, Predicate, drop_name, predicates
from executive.language.lexicon import VerbKind
from executive.language.limits import check_feasible, check_routes_and_speaker, not_understood, refuse_harm
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase, noun_phrases
from executive.language.questions import RefusalError, RefusalKind, Slot, abilities, which_question
from executive.language.reading import Reader
from executive.language.reference import Memory, resolve
from executive.language.roles import Location, prepositions, relate
from executive.language.tokens import Token, name_table, parse_with_names, rephrase
from executive.words.command import Command, is_attribute
from executive.words.knowledge import Knowledge
from executive.words.step import Step
from skills.inputs.errors import listing

_MOST_WORDS: Final = 60
_MOST_CHARACTERS: Final = 800


@dataclass(frozen=True)
class Trace:
    """Result of each step for a sentence, in the order of the fields; steps after a refusal are empty.

    The first fields are inputs. `memory` has the referents from earlier sentences, and at the end those from this one.
    `lead` are items before the words, `elliptic` allows an omitted "it", `recipient` receives objects if nobody else.
    `unwanted` are phrases after "not", `taken_back` are those and what the speaker has corrected, `meanings` are
    pronouns with their meanings, `notes` list names that were interpreted as others. `refused_at` is the step that
    refused the sentence. If it has conditions, loops or waits, `steps` is its mission and `parts` are its clauses.
    """

    text: str
    memory: Memory = field(default_factory=Memory)
    lead: tuple[Item, ...] = ()
    elliptic: bool = False
    recipient: Location | None = None

    opened: str = ""
    tokens: tuple[Token, ...] = ()
    items: tuple[Item, ...] = ()
    unwanted: tuple[Phrase, ...] = ()
    taken_back: tuple[str, ...] = ()
    clauses: tuple[Predicate, ...] = ()
    actions: tuple[Action, ...] = ()
    resolved: tuple[Action, ...] = ()
    frames: tuple[CommandFrame, ...] = ()
    meanings: tuple[tuple[str, str], ...] = ()
    commands: tuple[Command, ...] = ()
    notes: tuple[str, ...] = ()
    refusal: RefusalError | None = None
    refused_at: str | None = None
    parts: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()


@dataclass(frozen=True)
class Pipeline:
    """Steps from words to commands in one world; with `knowledge` None, all names stay as spoken."""

    parser: DependencyParser
    knowledge: Knowledge | None

    def run(self, trace: Trace, *, behind: str | None = None, upto: str | None = None) -> Trace:
        """Runs all steps, or those after one step and up to another, on a text without wake phrase. Never raises."""
        names = tuple(_STEPS)
        last = len(names) if upto is None else names.index(upto) + 1
        for name in names[0 if behind is None else names.index(behind) + 1 : last]:
            try:
                trace = _STEPS[name](self, trace)
            except RefusalError as refusal:
                return replace(trace, refusal=refusal, refused_at=name)
        return trace

    def _open(self, trace: Trace) -> Trace:
        if (words := len(trace.text.split())) > _MOST_WORDS:
            raise RefusalError(f"{words} words are too many for one sentence; say it in {_MOST_WORDS} at most")
        if len(trace.text) > _MOST_CHARACTERS:
            what = f"{len(trace.text)} characters are too many for one sentence; {_MOST_CHARACTERS} at most"
            raise RefusalError(what)
        return replace(trace, opened=rephrase(trace.text))

    def _parse(self, trace: Trace) -> Trace:
        table = None if self.knowledge is None else name_table(self.knowledge)
        return replace(trace, tokens=parse_with_names(trace.opened, self.parser.parse, table))

    def _read(self, trace: Trace) -> Trace:
        known = prepositions(related=self.knowledge is not None)
        items = Reader(trace.tokens, noun_phrases(trace.tokens), prepositions=known).read(trace.lead)
        repaired = repair_disfluencies(items)
        related = repaired if self.knowledge is None else relate(repaired)
        return replace(trace, items=related, unwanted=unwanted_phrases(items), taken_back=left_out(items, repaired))

    def _split(self, trace: Trace) -> Trace:
        clauses = predicates(trace.items)
        if not clauses:
            what = f"{trace.text!r} asks for nothing" if trace.text else "nothing was said"
            raise RefusalError(f"{what}; {abilities()}")
        refuse_harm(clauses)
        return replace(trace, clauses=clauses if self.knowledge else drop_name(clauses))

    def _act(self, trace: Trace) -> Trace:
        elliptic = trace.elliptic and bool(trace.memory.objects)
        return replace(trace, actions=read_actions(trace.clauses, elliptic=elliptic, recipient=trace.recipient))

    def _check(self, trace: Trace) -> Trace:
        """Refuses the whole sentence if some of its words were not understood."""
        notes, lost = cover(trace.items, trace.clauses, trace.actions)
        unknown = [(word, action.said) for action in trace.actions for word in action.unknown]
        lost = [one for one in lost if not any(word in one[0] or one[0] in word for word, _ in unknown)]
        if unknown or lost:
            raise not_understood([*unknown, *lost], self.knowledge)
        if trace.taken_back:
            notes.append(_NOT_MEANT.format(listing(map(repr, trace.taken_back))))
        notes += [_chosen(each, action.kind, trace.tokens) for action in trace.actions for each in action.choices]
        if self.knowledge is not None:
            check_routes_and_speaker(trace.clauses, trace.actions)
        if not any(action.kind for action in trace.actions):
            raise _nothing_to_do(trace.actions)
        return replace(trace, notes=(*trace.notes, *notes))

    def _refer(self, trace: Trace) -> Trace:
        found = resolve(trace.actions, trace.memory)
        return replace(trace, resolved=found.actions, memory=found.memory, meanings=found.meanings)

    def _check_feasible(self, trace: Trace) -> Trace:
        check_feasible(trace.resolved, self.knowledge)
        return trace

    def _command(self, trace: Trace) -> Trace:
        if self.knowledge is None:
            return replace(trace, commands=tuple(map(spoken_command, trace.frames)))
        grounded, notes = ground(trace.frames, self.knowledge, self.parser)
        commands = leave_out(trace.unwanted, grounded, self.knowledge)
        carried = "" if commands == grounded else _NOT_MEANT.format(listing(map(repr, trace.taken_back)))
        notes = (*(note for note in trace.notes if note != carried), *notes)
        return replace(trace, commands=commands, notes=notes)


_NOT_MEANT: Final = "I take {} not to be meant"
"""Note on what the speaker has corrected or denied, where the commands do not carry it."""


def _nothing_to_do(actions: Sequence[Action]) -> RefusalError:
    names = [phrase.text for action in actions for phrase in action.objects]
    of = f" of {listing(names)}" if names else ""
    return RefusalError(f"nothing to do was said{of}; {abilities()}", names, kind=RefusalKind.NOTHING_TO_DO)


def _chosen(choice: Sequence[Phrase], kind: VerbKind | None, tokens: Sequence[Token]) -> str:
    """Note on which of some phrases joined by "or" is meant. Raises RefusalError with a question if not any will do."""
    anything = all(one.tokens[0].word in ("a", "an", "any", "some") and not one.person for one in choice)
    if anything and kind is not VerbKind.FIND:
        return f"of {listing((one.spoken for one in choice), last='or')} I take the first"
    heard = " ".join(t.text for t in tokens[choice[0].content[0].index : choice[-1].head.index + 1]).replace(" ,", ",")
    place = all(phrase.kind is NounKind.PLACE for phrase in choice)
    slot = Slot.PLACE if place else Slot.PERSON if all(phrase.person for phrase in choice) else Slot.THING
    noun = choice[-1].head.text
    names = (f"{p.text} {noun}" if is_attribute(p.head.text) else p.text for p in choice)
    question = which_question(slot, slot.noun, tuple(dict.fromkeys(names)))
    raise RefusalError(question.text, (heard,), question=replace(question, heard=heard))


_STEPS: Final[dict[str, Callable[[Pipeline, Trace], Trace]]] = {
    "cleaning": Pipeline._open,
    "parsing": Pipeline._parse,
    "reading": Pipeline._read,
    "clauses": Pipeline._split,
    "actions": Pipeline._act,
    "understanding": Pipeline._check,
    "reference": Pipeline._refer,
    "feasibility": Pipeline._check_feasible,
    "command frames": lambda _, trace: replace(trace, frames=command_frames(trace.resolved)),
    "grounding": Pipeline._command,
}
