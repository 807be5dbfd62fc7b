"""The sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Attachment of prepositions is where parsers err most; the row keeps the order of the words, and the verbs decide later
which place plays which role."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Final

from executive.language.lexicon import PrepositionRole, VerbKind, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token


@dataclass(frozen=True)
class Verb:
    """A verb that the robot understands, with its particles."""

    text: str
    kinds: frozenset[VerbKind]


def verb(text: str) -> Verb:
    """A verb of the dictionary as an item."""
    return Verb(text, lexicon().verbs[tuple(text.split())])


@dataclass(frozen=True)
class Chunk:
    """A noun phrase with the preposition before it; `role` is None for a bare one."""

    phrase: Phrase
    preposition: str = ""
    role: PrepositionRole | None = None

    @property
    def spoken(self) -> str:
        """All words as spoken."""
        return f"{self.preposition} {self.phrase.spoken}".strip()


@dataclass(frozen=True)
class Adverb:
    """ "Here" or "there"."""

    here: bool

    @property
    def word(self) -> str:
        """The word as spoken."""
        return "here" if self.here else "there"


@dataclass(frozen=True)
class Being:
    """A form of "to be" as spoken; `existential` with "there", `asked` when it stands before its subject.

    `teller` is somebody who did something with a thing, so that it is where it is ("Anna left her umbrella");
    `narrated` says that it is any verb by which something is told ("somebody spilled milk on the floor"), and
    `topic` is the thing that it is told of ("the ball rolled under the sofa").
    """

    text: str
    existential: bool
    asked: bool
    teller: Phrase | None = None
    narrated: bool = False
    topic: Phrase | None = None


@dataclass(frozen=True)
class Whether:
    """ "If" or "whether"."""


@dataclass(frozen=True)
class Separator:
    """A comma, "and", "or", "then"."""

    word: str


@dataclass(frozen=True)
class Unknown:
    """A word that nothing accounts for."""

    word: str


@dataclass(frozen=True)
class Outside:
    """A verb that the robot does not know; what follows belongs to it."""

    word: str


@dataclass(frozen=True)
class Negation:
    """ "Not" and its kin: the speaker leaves out what follows."""

    word: str


@dataclass(frozen=True)
class Correction:
    """ "No", "I mean": what follows takes the place of what was said; a `soft` one may also mean nothing."""

    word: str
    soft: bool


Item = Verb | Chunk | Adverb | Being | Whether | Separator | Unknown | Outside | Negation | Correction


def spoken_words(items: Iterable[Item]) -> str:
    """The words of the items as spoken, small words left out."""
    words = (
        item.spoken if isinstance(item, Chunk) else getattr(item, "word", getattr(item, "text", ""))
        for item in items
        if not isinstance(item, Separator)
    )
    return " ".join(filter(None, words))


LONGEST: Final = 6
"""So many words has the longest phrase of the dictionaries."""


@dataclass
class Row:
    """The words of a sentence, its noun phrases by their first word, and the next word to be read.

    Words in `silent` are passed over.
    """

    tokens: Sequence[Token]
    phrases: Mapping[int, Phrase]
    at: int = 0
    silent: set[int] = field(default_factory=set)

    def match(self, phrases: Container[tuple[str, ...]]) -> tuple[str, ...] | None:
        """The longest of the phrases that stands here."""
        for length in range(LONGEST, 0, -1):
            piece = self.tokens[self.at : self.at + length]
            spoken = tuple(t.word for t in piece)
            if len(piece) == length and spoken in phrases:
                return spoken
        return None

    def phrase_at(self, start: int) -> Phrase | None:
        """The noun phrase that begins at `start`, also when what came before took its first words."""
        whole = self.phrases.get(start)
        if whole is not None:
            return whole
        cut = next((p for first, p in self.phrases.items() if first < start < first + len(p.tokens)), None)
        return None if cut is None else Phrase(tuple(t for t in cut.tokens if t.index >= start))

    def take(self, count: int) -> str:
        """The next words, which are then read."""
        self.at += count
        return " ".join(t.text for t in self.tokens[self.at - count : self.at])

    def ahead(self, count: int = 1) -> Sequence[Token]:
        """The `count` words behind the next one, fewer at the end."""
        return self.tokens[self.at + 1 : self.at + 1 + count]


def command_position(items: Sequence[Item]) -> bool:
    """Whether a command may begin behind these items."""
    return not items or isinstance(items[-1], Separator)


@dataclass(frozen=True)
class Predicate:
    """A verb, or a form of "to be", with the items behind it; a verb may be one that the robot does not know.

    `verb` is None for what stands before the first verb; `subject` stood before a form of "to be"; `whether` says that
    "if" or "whether" did.
    """

    verb: Verb | Being | Outside | None
    items: tuple[Item, ...] = ()
    subject: Chunk | None = None
    whether: bool = False


def predicates(items: Iterable[Item]) -> tuple[Predicate, ...]:
    """Cut the row of items at its verbs."""
    found: list[Predicate] = [Predicate(None)]
    for item in items:
        if isinstance(item, Being):
            found = [*found[:-1], *_begin_being(found[-1], item)]
        elif isinstance(item, Verb | Outside):
            found.append(Predicate(item))
        else:
            found[-1] = replace(found[-1], items=(*found[-1].items, item))
    whole = (clause for clause in found if clause.verb is not None or _content(clause.items))
    return tuple(part for clause in whole for part in _ungapped(clause))


def _ungapped(clause: Predicate) -> Iterator[Predicate]:
    """Say the verb again where it was left out: "a beer to Robin and a coke to Charlie"."""
    given = next((n for n in range(1, len(clause.items) - 1) if _gives_another(clause.items, n)), None)
    if given is not None and isinstance(clause.verb, Verb):
        yield replace(clause, items=clause.items[:given])
        yield from _ungapped(Predicate(clause.verb, clause.items[given + 1 :]))
        return
    cut = next((n for n in range(1, len(clause.items) - 1) if _gap(clause.items, n)), None)
    if cut is None or not isinstance(clause.verb, Verb):
        yield clause
        return
    yield replace(clause, items=clause.items[:cut])
    first = clause.items[0]
    recipient = (first,) if isinstance(first, Chunk) and first.role is None and first.phrase.speaker else ()
    yield from _ungapped(Predicate(clause.verb, (*recipient, *clause.items[cut + 1 :])))


def _gives_another(items: Sequence[Item], at: int) -> bool:
    """Whether somebody else and what they are given stand behind a separator: "me the book and Anna the pen"."""
    joint, who, what = items[at], items[at + 1], items[at + 2] if at + 2 < len(items) else None
    if not (isinstance(joint, Separator) and isinstance(who, Chunk) and isinstance(what, Chunk)):
        return False
    bare = who.role is None and what.role is None and isinstance(items[at - 1], Chunk)
    return bare and (who.phrase.person or who.phrase.speaker) and not (what.phrase.person or what.phrase.speaker)


def _gap(items: Sequence[Item], at: int) -> bool:
    """Whether a separator stands between two things that each have a place of the same role."""
    joint, thing, place = items[at], items[at + 1], items[at + 2] if at + 2 < len(items) else None
    if not (isinstance(joint, Separator) and isinstance(thing, Chunk) and isinstance(place, Chunk)):
        return False
    bare = [item for item in items[:at] if isinstance(item, Chunk) and item.role is None and not item.phrase.speaker]
    roles = [item.role for item in items[:at] if isinstance(item, Chunk) and item.role is not None]
    return thing.role is None and place.role is not None and bool(bare) and place.role in roles


def _content(items: Sequence[Item]) -> bool:
    return any(not isinstance(item, Separator) for item in items)


def _begin_being(last: Predicate, being: Being) -> list[Predicate]:
    """Begin a clause of "to be", which takes its subject, and the "if" before it, from the clause before."""
    rest = last.items
    subject = rest[-1] if rest and isinstance(rest[-1], Chunk) and not being.existential else None
    if subject is None or subject.role is not None:
        subject = None
    else:
        rest = rest[:-1]
    whether = bool(rest) and isinstance(rest[-1], Whether)
    asked = being.asked and subject is None
    before = replace(last, items=rest[: len(rest) - whether])
    return [before, Predicate(replace(being, asked=asked), (), subject, whether)]


def without_name(clauses: Sequence[Predicate]) -> tuple[Predicate, ...]:
    """Leave out a bare name before the first verb: it calls somebody ("Michael go to the kitchen")."""
    first, *rest = clauses or [Predicate(None)]
    content = [item for item in first.items if not isinstance(item, Separator)]
    name = content[0] if len(content) == 1 and isinstance(content[0], Chunk) and content[0].role is None else None
    joined = any(isinstance(item, Separator) and item.word in ("and", "or") for item in first.items)
    comma = isinstance(first.items[-1], Separator) and first.items[-1].word == "," if first.items else False
    called = name is not None and not joined and (name.phrase.named_person or (comma and name.phrase.proper))
    return tuple(rest if first.verb is None and called and rest else clauses)


def requested(predicates: Sequence[Predicate]) -> list[Predicate]:
    """The predicates as they are meant: a place before the first verb behind it, reasons and "check if" left out."""
    return list(_without_checks(_without_reasons(_with_fronted(_with_verb(predicates)))))


def _with_verb(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Say "take" where there is no verb at all: "hammer to the kitchen, please"."""
    items = [item for clause in clauses for item in clause.items if not isinstance(item, Separator)]
    chunks = [item for item in items if isinstance(item, Chunk)]
    carried = [chunk.role for chunk in chunks] == [None, PrepositionRole.GOAL] and len(chunks) == len(items)
    if len(clauses) != 1 or clauses[0].verb is not None or not carried or chunks[0].phrase.kind is not NounKind.THING:
        return clauses
    return (replace(clauses[0], verb=verb(_TAKE)),)


def _with_fronted(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Put a place that stands before the first verb behind it: "from the kitchen bring me a spoon"."""
    if len(clauses) < 2 or clauses[0].verb is not None or not isinstance(clauses[1].verb, Verb | Being):
        return clauses
    fronted = [item for item in clauses[0].items if not isinstance(item, Separator)]
    if _named_first(fronted, clauses[1]):
        return (replace(clauses[0], verb=Being("", existential=True, asked=False)), *clauses[1:])
    places = all(isinstance(item, Chunk) and item.role in _FRONTED for item in fronted)
    first = replace(clauses[1], items=(*clauses[1].items, *fronted))
    return (first, *clauses[2:]) if places else clauses


def _named_first(fronted: Sequence[Item], clause: Predicate) -> bool:
    """Whether a thing is only named, and then meant by "it": "that vase on the shelf, bring it here"."""
    chunks = [item for item in fronted if isinstance(item, Chunk)]
    named = len(chunks) == len(fronted) and bool(chunks) and chunks[0].role is None and not chunks[0].phrase.pronoun
    placed = named and all(chunk.role in _FRONTED for chunk in chunks[1:]) and not chunks[0].phrase.speaker
    meant = [item.phrase for item in clause.items if isinstance(item, Chunk)]
    return placed and any(phrase.pronoun or phrase.text == chunks[0].phrase.text for phrase in meant)


def _without_reasons(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Leave out what the speakers say that they are about to do themselves, before or after what is to be done."""
    if len(clauses) > 1 and _own_affair(clauses[-1].verb) and isinstance(clauses[-2].verb, Verb):
        items = clauses[-2].items
        at = next((n for n in range(len(items) - 1, -1, -1) if isinstance(items[n], Chunk)), None)
        last = None if at is None else items[at]
        wants = [item.word for item in items[(at or 0) + 1 :] if isinstance(item, Unknown)]
        if at is not None and isinstance(last, Chunk) and last.phrase.speaker and at > 0 and wants[-1:] == ["to"]:
            return (*clauses[:-2], replace(clauses[-2], items=items[:at]))
    if len(clauses) < 3 or clauses[0].verb is not None or not isinstance(clauses[2].verb, Verb):
        return clauses
    first, act = clauses[0].items, clauses[1].verb
    wants = [item.word for item in first if isinstance(item, Unknown)]
    speaker = bool(first) and isinstance(first[0], Chunk) and first[0].phrase.speaker
    return clauses[2:] if speaker and _own_affair(act) and wants[-1:] == ["to"] else clauses


def _own_affair(verb: Verb | Being | Outside | None) -> bool:
    """Whether it is nothing that a robot does, and nothing that it is asked for, either."""
    return isinstance(verb, Outside) and verb.word.lower() not in lexicon().asks


def _without_checks(clauses: Sequence[Predicate]) -> Iterator[Predicate]:
    """Leave out "see" and "check" before "if there is": the question stands alone."""
    asks = False
    for clause, after in zip_longest(clauses, clauses[1:]):
        bare = _checks(clause) and _only_whether(clause)
        if clause.whether and not asks:
            clause = replace(clause, verb=Outside(_IF))
        asks = bare and after is not None and after.whether
        if not asks and not (bare and after is not None and isinstance(after.verb, Verb)):
            yield clause


def _checks(clause: Predicate | None) -> bool:
    """Whether its verb asks how things stand."""
    return clause is not None and isinstance(clause.verb, Verb) and VerbKind.CHECK in clause.verb.kinds


def _only_whether(clause: Predicate) -> bool:
    """Whether nothing but "if" stands behind its verb, as in "see if you can find it"."""
    return all(isinstance(item, Separator | Whether) for item in clause.items)


_FRONTED: Final = frozenset({PrepositionRole.SOURCE, PrepositionRole.GOAL, PrepositionRole.AT, PrepositionRole.BESIDE})
_TAKE: Final = "take"
_IF: Final = "if"
