"""Represents a sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Parsers err most in the attachment of prepositions; the row keeps the order, and verbs give places their roles later.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
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

    @property
    def placed(self) -> bool:
        """Returns whether the preposition makes the noun phrase a place."""
        return self.role not in (None, PrepositionRole.FOR, PrepositionRole.PATH)


@dataclass(frozen=True)
class Adverb:
    """ "Here" or "there"."""

    here: bool


@dataclass(frozen=True)
class Being:
    """Form of "to be"; `existential` with "there", `asked` before its subject.

    `teller` is who left an object at its place ("Anna left her umbrella"), `narrated` marks any verb in a narration
    ("somebody spilled milk on the floor"), `topic` is what a narration is about ("the ball rolled under the sofa").
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
    kept = (item for item in items if not isinstance(item, Separator))
    words = (one.spoken if isinstance(one, Chunk) else getattr(one, "word", getattr(one, "text", "")) for one in kept)
    return " ".join(filter(None, words))


def without_objects(items: Sequence[Item]) -> tuple[Item, ...]:
    """Verb with its recipient and goal, to be used for another object; empty if there are several verbs."""
    match [item for item in items if isinstance(item, Verb | Being | Outside | Negation | Correction)]:
        case [Verb() as only]:
            at = {VerbKind.PLACE, VerbKind.FIND} & only.kinds or only.text in word_list("at_is_goal")
            roles = (PrepositionRole.GOAL, *((PrepositionRole.AT, PrepositionRole.BESIDE) if at else ()))
            kept = [one for one in chunks(items) if one.role in roles or one.phrase.receiver]
            return tuple(item for item in items if isinstance(item, Verb | Adverb) or item in kept)
    return ()


def chunks(items: Iterable[Item]) -> list[Chunk]:
    """Noun phrases among the items."""
    return [item for item in items if isinstance(item, Chunk)]


def last_index(items: Sequence[Item], fits: Callable[[Item], bool]) -> int | None:
    """Index of the last item that fits; None if none does."""
    return next((n for n in range(len(items) - 1, -1, -1) if fits(items[n])), None)


LONGEST: Final = 8
"""Number of words of the longest phrase in the dictionaries."""


@dataclass
class Row:
    """Words of a sentence, the noun phrases by their first word, the reader's position, and words that it skips."""

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
    """Verb, or a form of "to be", with the items after it; `verb` is None for items before the first verb.

    `subject` precedes a form of "to be", and `whether` is True if "if" or "whether" precedes the subject.
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
    return tuple(part for clause in found if clause.verb or clause.content for part in _ungapped(clause))


def _ungapped(clause: Predicate) -> Iterator[Predicate]:
    """Repeats an omitted verb: "a beer to Robin and a coke to Charlie"."""
    items, joints = clause.items, range(1, len(clause.items) - 2)
    gift = next((at for at in joints if _is_gift(items[at - 1 : at + 3])), None)
    cut = next((at for at in joints if _is_gap(items[:at], items[at : at + 3])), None) if gift is None else gift
    if cut is None or not isinstance(clause.verb, Verb):
        yield clause
        return
    recipient = [one for one in chunks(items[:1]) if gift is None and one.role is None and one.phrase.speaker]
    yield replace(clause, items=items[:cut])
    yield from _ungapped(Predicate(clause.verb, (*recipient, *items[cut + 1 :])))


def _is_gift(items: Sequence[Item]) -> bool:
    """Returns whether somebody else is given something else: "(me) the book and Anna the pen"."""
    match items:
        case [Chunk(), Separator(), Chunk(role=None, phrase=who), Chunk(role=None, phrase=what)]:
            return who.receiver and not what.receiver
    return False


def _is_gap(before: Sequence[Item], items: Sequence[Item]) -> bool:
    """Returns whether another object gets a place with the same role as the place of the object before."""
    match items:
        case [Separator(), Chunk(role=None), Chunk(role=PrepositionRole() as role)]:
            roles = {one.role for one in chunks(before) if not (one.role is None and one.phrase.speaker)}
            return {None, role} <= roles
    return False


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
    match clauses:
        case [Predicate(verb=None, content=[Chunk(role=None, phrase=name)], items=items), _, *_]:
            words = [item.word if isinstance(item, Separator) else "" for item in items]
            called = name.named_person or (words[-1] == "," and name.proper)
            return tuple(clauses[1:] if called and not {"and", "or"} & {*words} else clauses)
    return tuple(clauses)


def requested_predicates(predicates: Sequence[Predicate]) -> list[Predicate]:
    """Normalises predicates: moves a fronted place after its verb, removes reasons and "check if"."""
    return list(_without_checks(_without_reasons(_with_fronted(_with_verb(predicates)))))


def _with_verb(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Adds "take" to a sentence without a verb: "hammer to the kitchen, please"."""
    match clauses:
        case [Predicate(verb=None, content=[Chunk(role=None, phrase=named), Chunk(role=PrepositionRole.GOAL)]) as only]:
            return (replace(only, verb=verb("take")),) if named.kind is NounKind.THING else clauses
    return clauses


def _with_fronted(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Moves a place before the first verb after it: "from the kitchen bring me a spoon"."""
    match clauses:
        case [Predicate(verb=None, content=fronted) as first, Predicate(verb=Verb() | Being()) as second, *rest]:
            named = [one.phrase for one in chunks(fronted[:1]) if one.role is None]
            if not all(isinstance(item, Chunk) and item.placed for item in fronted[len(named) :]):
                return clauses
            if not named:
                return (replace(second, items=(*second.items, *fronted)), *rest)
            meant = [one.phrase for one in chunks(second.items)]
            again = any(phrase.pronoun or phrase.text == named[0].text for phrase in meant)
            if again and not (named[0].pronoun or named[0].speaker):  # that vase on the shelf, bring it here
                return (replace(first, verb=Being("", existential=True, asked=False)), second, *rest)
    return clauses


def _without_reasons(clauses: Sequence[Predicate]) -> Sequence[Predicate]:
    """Removes the speaker's own plans before or after the request."""
    match clauses:
        case [*others, Predicate(verb=Verb(), items=items) as request, plan]:
            at = last_index(items, lambda item: isinstance(item, Chunk))
            if at and _is_own_affair(items[at:], plan.verb):
                return (*others, replace(request, items=items[:at]))
    match clauses:
        case [Predicate(verb=None, items=items), plan, Predicate(verb=Verb()), *_] if _is_own_affair(items, plan.verb):
            return clauses[2:]
    return clauses


def _is_own_affair(items: Sequence[Item], verb: Verb | Being | Outside | None) -> bool:
    """Returns whether a verb expresses a plan of the speaker and no request: "I am about to sing"."""
    wants = [item.word for item in items if isinstance(item, Unknown)]
    asked = not isinstance(verb, Outside) or verb.word.lower() in word_list("asks")
    return not asked and wants[-1:] == ["to"] and isinstance(items[0], Chunk) and items[0].phrase.speaker


def _without_checks(clauses: Sequence[Predicate]) -> Iterator[Predicate]:
    """Removes "see" and "check" before "if there is": only the question remains."""
    asks = False
    for clause, after in zip_longest(clauses, clauses[1:]):
        if clause.whether and not asks:
            clause = replace(clause, verb=Outside("if"))
        checks = after is not None and isinstance(clause.verb, Verb) and VerbKind.CHECK in clause.verb.kinds
        bare = checks and all(isinstance(item, Separator | Whether) for item in clause.items)
        asks = bare and after.whether
        if not asks and not (bare and isinstance(after.verb, Verb)):
            yield clause
