"""Represents a sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Parsers err most in the attachment of prepositions; the row keeps the order of the words, and the verbs assign roles to
the places later.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Final

from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import NO_TOKEN, Token, longest_of


@dataclass(frozen=True)
class Verb:
    """Verb that the robot understands, with the verb's particles."""

    text: str
    kinds: frozenset[VerbKind]


def verb(text: str) -> Verb:
    """Makes an item from a verb in the dictionary."""
    return Verb(text, lexicon().verbs[tuple(text.split())])


@dataclass(frozen=True)
class Chunk:
    """Noun phrase with the preposition before it; `role` is None if it has no preposition."""

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


@dataclass(frozen=True)
class Being:
    """Form of "to be"; `existential` with "there", `asked` before its subject.

    `teller` is the person who left an object at its place ("Anna left her umbrella"). `narrated` marks any verb in a
    narration ("somebody spilled milk on the floor"), and `topic` is what the narration is about ("the ball rolled under
    the sofa").
    """

    text: str
    existential: bool
    asked: bool
    teller: Phrase | None = None
    narrated: bool = False
    topic: Phrase | None = None


@dataclass(frozen=True)
class Whether:
    """Word "if" or "whether"."""


@dataclass(frozen=True)
class _Word:
    word: str


class Separator(_Word):
    """Comma, "and", "or", "then"."""


class Aside(Separator):
    """Words that change nothing of what the robot does; a note names them."""


class Unknown(_Word):
    """Word that does not fit anywhere in the sentence."""


class Outside(_Word):
    """Verb that the robot does not know; the items after it belong to this verb."""


class Negation(_Word):
    """Words such as "not", by which the speaker excludes the next item."""


@dataclass(frozen=True)
class Correction(_Word):
    """Words such as "no": the next item replaces an earlier item; a `soft` correction may also mean nothing."""

    soft: bool


Item = Verb | Chunk | Adverb | Being | Whether | Separator | Unknown | Outside | Negation | Correction


def spoken_words(items: Iterable[Item]) -> str:
    """Words of the items as spoken, without small words."""
    words = (
        item.spoken if isinstance(item, Chunk) else getattr(item, "word", getattr(item, "text", ""))
        for item in items
        if not isinstance(item, Separator)
    )
    return " ".join(filter(None, words))


def without_objects(items: Sequence[Item]) -> tuple[Item, ...]:
    """Verb with its recipient and goal, to be used for another object; empty if there are several verbs."""
    verbs = [item for item in items if isinstance(item, Verb | Being | Outside | Negation | Correction)]
    if len(verbs) != 1 or not isinstance(verbs[0], Verb):
        return ()
    at = {VerbKind.PLACE, VerbKind.FIND} & verbs[0].kinds or verbs[0].text in word_list("at_is_goal")
    roles = (PrepositionRole.GOAL, *((PrepositionRole.AT, PrepositionRole.BESIDE) if at else ()))
    return tuple(
        item
        for item in items
        if isinstance(item, Verb | Adverb) or (isinstance(item, Chunk) and (item.role in roles or item.phrase.receiver))
    )


LONGEST: Final = 8
"""Number of words of the longest phrase in the dictionaries."""


@dataclass
class Row:
    """Words of a sentence, the noun phrases by their first word, and the reader's position.

    The reader skips words in `silent`.
    """

    tokens: Sequence[Token]
    phrases: Mapping[int, Phrase]
    at: int = 0
    silent: set[int] = field(default_factory=set)
    prepositions: Mapping[tuple[str, ...], PrepositionRole] = field(default_factory=lambda: lexicon().prepositions)

    def token(self, ahead: int = 0) -> Token:
        """Word at the position, or `ahead` of it; a word without text outside the sentence."""
        at = self.at + ahead
        return self.tokens[at] if 0 <= at < len(self.tokens) else NO_TOKEN

    def word(self, ahead: int = 0) -> str:
        """Text of a word in lower case; empty outside the sentence."""
        return self.token(ahead).word

    def match(self, phrases: Container[tuple[str, ...]], ahead: int = 0) -> tuple[str, ...]:
        """Longest of the phrases that begins at the position, or `ahead` of it; empty if none does."""
        start = self.at + ahead
        return longest_of(phrases, [t.word for t in self.tokens[start : start + LONGEST]])

    def phrase_at(self, start: int) -> Phrase | None:
        """Noun phrase that begins at `start`, even if its first words have been taken."""
        tokens = next((p.tokens for at, p in self.phrases.items() if at <= start < at + len(p.tokens)), ())
        rest = tuple(token for token in tokens if token.index >= start)
        return Phrase(rest) if rest else None

    def take(self, count: int) -> str:
        """Takes the next words, and moves the position behind them."""
        self.at += count
        return " ".join(t.text for t in self.tokens[self.at - count : self.at])


def may_begin_command(items: Sequence[Item]) -> bool:
    """Returns whether a command may begin after these items."""
    return not items or isinstance(items[-1], Separator)


@dataclass(frozen=True)
class Predicate:
    """Verb, or a form of "to be", with the items after it; the robot may not know the verb.

    `verb` is None for items before the first verb; `subject` precedes a form of "to be"; `whether` is True if "if" or
    "whether" precedes the subject.
    """

    verb: Verb | Being | Outside | None
    items: tuple[Item, ...] = ()
    subject: Chunk | None = None
    whether: bool = False

    @property
    def content(self) -> tuple[Item, ...]:
        """Items without separators."""
        return tuple(item for item in self.items if not isinstance(item, Separator))


def predicates(items: Iterable[Item]) -> tuple[Predicate, ...]:
    """Splits the row of items into predicates, one for each verb."""
    found: list[Predicate] = [Predicate(None)]
    for item in items:
        if isinstance(item, Being):
            found = [*found[:-1], *_begin_being(found[-1], item)]
        elif isinstance(item, Verb | Outside):
            found.append(Predicate(item))
        else:
            found[-1] = replace(found[-1], items=(*found[-1].items, item))
    whole = (clause for clause in found if clause.verb is not None or clause.content)
    return tuple(part for clause in whole for part in _ungapped(clause))


def _ungapped(clause: Predicate) -> Iterator[Predicate]:
    """Repeats an omitted verb: "a beer to Robin and a coke to Charlie"."""
    items = clause.items
    pairs = [
        (n, one, other)
        for n, (joint, one, other) in enumerate(zip(items[1:], items[2:], items[3:], strict=False), 1)
        if isinstance(joint, Separator) and isinstance(one, Chunk) and isinstance(other, Chunk) and one.role is None
    ]
    # me the book and Anna the pen
    gifts = [n for n, who, what in pairs if what.role is None and who.phrase.receiver and not what.phrase.receiver]
    cut, recipient = next((n for n in gifts if isinstance(items[n - 1], Chunk)), None), tuple[Item, ...]()
    if cut is None and (cut := next((n for n, _, place in pairs if _gap(items[:n], place)), None)) is not None:
        first = items[0]
        recipient = (first,) if isinstance(first, Chunk) and first.role is None and first.phrase.speaker else ()
    if cut is None or not isinstance(clause.verb, Verb):
        yield clause
        return
    yield replace(clause, items=items[:cut])
    yield from _ungapped(Predicate(clause.verb, (*recipient, *items[cut + 1 :])))


def _gap(items: Sequence[Item], place: Chunk) -> bool:
    """Returns whether the items have an object, and a place with the same role as another object's place."""
    before = [item for item in items if isinstance(item, Chunk)]
    bare = any(item.role is None and not item.phrase.speaker for item in before)
    return bare and place.role is not None and place.role in [item.role for item in before]


def _begin_being(last: Predicate, being: Being) -> list[Predicate]:
    """Begins a clause with "to be"; takes its subject, and the "if" before the subject, from the clause before."""
    before = last.items[-1] if last.items and not being.existential else None
    subject = before if isinstance(before, Chunk) and before.role is None else None
    rest = last.items[: len(last.items) - (subject is not None)]
    whether = bool(rest) and isinstance(rest[-1], Whether)
    asked = replace(being, asked=being.asked and subject is None)
    return [replace(last, items=rest[: len(rest) - whether]), Predicate(asked, (), subject, whether)]


def drop_name(clauses: Sequence[Predicate]) -> tuple[Predicate, ...]:
    """Removes a name without a comma before the first verb, which calls somebody ("Michael go to the kitchen")."""
    first, *rest = clauses or [Predicate(None)]
    name = first.content[0] if len(first.content) == 1 else None
    if first.verb is not None or not rest or not isinstance(name, Chunk) or name.role is not None:
        return tuple(clauses)
    words = [item.word if isinstance(item, Separator) else "" for item in first.items]
    called = name.phrase.named_person or (words[-1] == "," and name.phrase.proper)
    return tuple(rest if called and not {"and", "or"} & {*words} else clauses)


def requested_predicates(predicates: Sequence[Predicate]) -> list[Predicate]:
    """Normalises predicates: moves a fronted place after its verb, removes reasons and "check if"."""
    return list(_without_checks(_without_reasons(_with_fronted(_with_verb(predicates)))))


def _with_verb(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Adds "take" to a sentence without a verb: "hammer to the kitchen, please"."""
    items = [item for clause in clauses for item in clause.content]
    chunks = [item for item in items if isinstance(item, Chunk)]
    carried = [chunk.role for chunk in chunks] == [None, PrepositionRole.GOAL] and len(chunks) == len(items)
    if len(clauses) != 1 or clauses[0].verb is not None or not carried or chunks[0].phrase.kind is not NounKind.THING:
        return clauses
    return (replace(clauses[0], verb=verb("take")),)


def _with_fronted(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Moves a place before the first verb after it: "from the kitchen bring me a spoon"."""
    if len(clauses) < 2 or clauses[0].verb is not None or not isinstance(clauses[1].verb, Verb | Being):
        return clauses
    fronted = clauses[0].content
    chunks = [item for item in fronted if isinstance(item, Chunk)]
    if len(chunks) < len(fronted):
        return clauses
    if chunks and chunks[0].role is None:  # that vase on the shelf, bring it here
        named = chunks[0].phrase
        placed = all(chunk.role in PLACES for chunk in chunks[1:]) and not (named.pronoun or named.speaker)
        meant = [item.phrase for item in clauses[1].items if isinstance(item, Chunk)]
        if placed and any(phrase.pronoun or phrase.text == named.text for phrase in meant):
            return (replace(clauses[0], verb=Being("", existential=True, asked=False)), *clauses[1:])
    if not all(chunk.role in PLACES for chunk in chunks):
        return clauses
    return (replace(clauses[1], items=(*clauses[1].items, *fronted)), *clauses[2:])


def _without_reasons(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Removes the speaker's own plans before or after the request."""

    def own_affair(verb: Verb | Being | Outside | None, before: Sequence[Item]) -> bool:
        """Returns whether the verb expresses a plan of the speaker and no request: "I am about to sing"."""
        wants = [item.word for item in before if isinstance(item, Unknown)]
        return isinstance(verb, Outside) and verb.word.lower() not in word_list("asks") and wants[-1:] == ["to"]

    if len(clauses) > 1 and isinstance(clauses[-2].verb, Verb):
        items = clauses[-2].items
        at = next((n for n in range(len(items) - 1, -1, -1) if isinstance(items[n], Chunk)), 0)
        last = items[at] if items else None
        speaks = at > 0 and isinstance(last, Chunk) and last.phrase.speaker
        if speaks and own_affair(clauses[-1].verb, items[at + 1 :]):
            return (*clauses[:-2], replace(clauses[-2], items=items[:at]))
    if len(clauses) < 3 or clauses[0].verb is not None or not isinstance(clauses[2].verb, Verb):
        return clauses
    first = clauses[0].items
    speaker = bool(first) and isinstance(first[0], Chunk) and first[0].phrase.speaker
    return clauses[2:] if speaker and own_affair(clauses[1].verb, first) else clauses


def _without_checks(clauses: Sequence[Predicate]) -> Iterator[Predicate]:
    """Removes "see" and "check" before "if there is": only the question remains."""
    asks = False
    for clause, after in zip_longest(clauses, clauses[1:]):
        checks = isinstance(clause.verb, Verb) and VerbKind.CHECK in clause.verb.kinds
        bare = checks and all(isinstance(item, Separator | Whether) for item in clause.items)
        if clause.whether and not asks:
            clause = replace(clause, verb=Outside("if"))
        asks = bare and after is not None and after.whether
        if not asks and not (bare and after is not None and isinstance(after.verb, Verb)):
            yield clause


PLACES: Final = frozenset({PrepositionRole.SOURCE, PrepositionRole.GOAL, PrepositionRole.AT, PrepositionRole.BESIDE})
"""Roles of places after a preposition."""
