"""Finds noun phrases: the words around a noun, and what they mean."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Final

from executive.language.amounts import number_of_word, number_of_words
from executive.language.lexicon import word_list
from executive.language.nouns import NounKind
from executive.language.tokens import Token
from skills.api import ObjectKind
from skills.descriptions import plural
from skills.relations import RelationKind

_LEFT: Final = frozenset(
    {"det", "amod", "compound", "nummod", "poss", "nmod", "predet", "quantmod", "advmod", "case", "npadvmod", "punct"}
)
_NOMINAL: Final = frozenset({"NOUN", "PROPN", "PRON", "NUM", "X"})
_DEEPEST: Final = 6
_ALL: Final = "all"
_ONE: Final = frozenset({"one", "ones"})
_DIGITS: Final = re.compile(r"-?\d+(?:[.,]\d+)?")
_HEADLIKE: Final = frozenset({"obj", "iobj", "obl", "nsubj", "attr", "conj", "root"})


@dataclass(frozen=True)
class SpokenRelation:
    """Relation as spoken before and behind a noun, with its landmarks, and the number in a row."""

    kind: RelationKind
    behind: str
    landmarks: tuple[Phrase, ...] = ()
    nth: int = 1
    before: tuple[Token, ...] = ()

    @property
    def said(self) -> str:
        """Words of the relation."""
        return " ".join(filter(None, (*(t.text for t in self.before), self.behind)))


@dataclass(frozen=True)
class Phrase:
    """Noun with the words around it.

    `extra` are the words joined after the noun ("of wine"), `of_kind` is the kind of the noun after "of", and
    `numbered` is a count that was said separately ("make that two"). `relations` say which object is meant, or of a
    surface, where on it.
    """

    tokens: tuple[Token, ...]
    extra: tuple[str, ...] = ()
    of_kind: NounKind | None = None
    numbered: int | None = None
    relations: tuple[SpokenRelation, ...] = ()

    @property
    def head(self) -> Token:
        """Noun of the phrase."""
        return self.tokens[-1]

    @property
    def text(self) -> str:
        """Words as spoken, without article, possessive and number."""
        return _joined_text((*self.content, *self.extra))

    @property
    def singular(self) -> str:
        """Text of the phrase, with the noun in its dictionary form."""
        *left, head = self.content
        return _joined_text((*left, head.lemma, *self.extra))

    @property
    def object_kind(self) -> ObjectKind:
        """Kind of object that the phrase names; its leading adjectives become attributes."""
        words = self.content
        leads = next((n for n, t in enumerate(words[:-1]) if not t.adjective), len(words) - 1)
        return ObjectKind(_joined_text((*words[leads:], *self.extra)), tuple(t.text for t in words[:leads]))

    @property
    def plural(self) -> bool:
        """Returns whether the noun is plural."""
        return self.head.tag in ("NNS", "NNPS")

    @property
    def plural_head(self) -> Token:
        """Noun of the phrase in the plural."""
        return self.head if self.plural else replace(self.head, text=plural(self.head.text), tag="NNS")

    @property
    def count(self) -> int:
        """Number that was said; without a number, 1 for a singular and 0 for a plural."""
        said = self.said_count
        return said if said is not None else 0 if self.plural else 1

    @property
    def said_count(self) -> int | None:
        """Number that was said, or None; "one" and "two" without a noun count too."""
        said = next(map(number_of_words, self._numerals()), None)
        both = said is None and self.plural and self.tokens[0].word == "both"
        return self.numbered if self.numbered is not None else 2 if both else said

    @property
    def odd_number(self) -> str | None:
        """Words of a number that cannot count objects: "one two three", "zero", "infinity", "2.5", "at least two"."""
        left = self.tokens[:-1]
        if any(t.word in word_list("loose_numbers") for t in left) and any(self._numerals()):
            return " ".join(t.text for t in left)
        odd = next((numeral for numeral in self._numerals() if not number_of_words(numeral)), None)
        return " ".join(odd or (t.text for t in left if t.word in word_list("no_numbers"))) or None

    @property
    def pronoun(self) -> bool:
        """Returns whether the phrase refers to an earlier phrase ("it", "one", "two of them")."""
        word = self.head.word in word_list("pronouns") and not self.stands_for_one
        return word and not self.extra and all(map(_is_determiner, self.tokens[:-1]))

    @property
    def stands_for_one(self) -> bool:
        """Returns whether the noun is "one", with words before it ("the red one")."""
        return self.head.word in _ONE and len(self.tokens) > 1

    @property
    def stands_for_somebody(self) -> bool:
        """Returns whether the phrase is a pronoun that can refer to a person."""
        return len(self.tokens) == 1 and self.head.word in word_list("somebody")

    @property
    def speaker(self) -> bool:
        """Returns whether the phrase means the speaker."""
        return len(self.tokens) == 1 and self.head.word in word_list("speaker") and not self.extra

    @property
    def person(self) -> bool:
        """Returns whether the phrase means a person: a noun for people, or a person's name."""
        return self.head.lemma in word_list("people") or self.head.word in word_list("people") or self.named_person

    @property
    def receiver(self) -> bool:
        """Returns whether the phrase means the speaker or a person, who can be handed objects."""
        return self.speaker or self.person

    @property
    def living(self) -> bool:
        """Returns whether the phrase means a person, by profession too, or an animal."""
        return self.person or self.kind is NounKind.PERSON

    @property
    def somebody(self) -> bool:
        """Returns whether the phrase means a person, or anybody."""
        return self.person or self.head.word in word_list("anyone")

    @property
    def named_person(self) -> bool:
        """Returns whether the phrase is a person's name."""
        if self._determined() or (self.plural and self.head.kind is not NounKind.PERSON):
            return False
        if self.head.known:
            return self.head.entity == "PERSON"
        proper = all(t.pos == "PROPN" for t in self.tokens)
        somebody = proper or self.head.kind is NounKind.PERSON
        titled = somebody and len(self.tokens) > 1 and self.tokens[0].word.rstrip(".") in word_list("titles")
        return titled or (self.head.kind is NounKind.PERSON and (proper or len(self.tokens) == 1))

    @property
    def proper(self) -> bool:
        """Returns whether the phrase is written as a proper name."""
        return not self._determined() and all(token.pos == "PROPN" for token in self.tokens)

    @property
    def universal(self) -> bool:
        """Returns whether the phrase means all of a kind ("everyone", "all the men"); "all the forks" does not."""
        words = {t.word for t in self.tokens} & word_list("everyone")
        return bool(words - {_ALL}) or (bool(words) and (self.person or not self.plural))

    @property
    def addressed(self) -> bool:
        """Returns whether the phrase means the robot, or something of the robot ("your phone"), which owns nothing."""
        if len(self.tokens) == 1 and self.head.word in ("you", "yourself"):
            return True
        held = self.kind is NounKind.THING or self.head.lemma in word_list("fixtures")
        return held and any(t.word == "your" and t.index < self.head.index for t in self.tokens)

    @property
    def indefinite(self) -> bool:
        """Returns whether the phrase means any object of its kind: it has "a" or no article, and no possessive."""
        return not any(t.word in word_list("definite") or t.tag in ("PRP$", "POS") for t in self.tokens)

    @property
    def known(self) -> bool:
        """Returns whether the world knows the phrase as a name."""
        return self.head.known

    @property
    def kind(self) -> NounKind | None:
        """Kind of the noun; for "a piece of advice" the kind of "advice"."""
        meant = self.head.lemma in word_list("quantities") or self.head.lemma in word_list("ends")
        return self.of_kind if meant and self.of_kind else self.head.kind

    @property
    def spoken(self) -> str:
        """All words as spoken."""
        behind = filter(None, (each.behind for each in self.relations))
        return " ".join((*(t.text for t in self.tokens), *self.extra, *behind))

    @property
    def counts(self) -> bool:
        """Returns whether the phrase is only a number ("two", "a couple")."""
        return number_of_word(self.head.word) is not None

    @property
    def distributed(self) -> Phrase:
        """Phrase "all cubes" for "each cube"; the phrase itself for other words, such as "every second cube"."""
        each, *between = self.tokens[:-1] or self.tokens
        one_of_many = len(self.tokens) > 1 and each.word in ("each", "every") and not (self.plural or self.person)
        counted = any(t.tag == "CD" or t.word in word_list("some_of_them") for t in between)
        fixed = self.kind is not None and (not self.kind.within_reach or self.head.lemma in word_list("fixtures"))
        if not one_of_many or counted or fixed or self.head.word in word_list("pronouns"):
            return self
        return replace(self, tokens=(replace(each, text=_ALL, lemma=_ALL), *between, self.plural_head))

    def with_extra(self, *words: str) -> Phrase:
        """Returns the phrase with additional words after the noun."""
        return replace(self, extra=(*self.extra, *words))

    def with_relation(self, relation: SpokenRelation) -> Phrase:
        """Returns the phrase with one more relation."""
        return replace(self, relations=(*self.relations, relation))

    def with_contents(self, inner: Phrase) -> Phrase:
        """Returns the phrase with "of" and the contents after the noun; a mere number has no contents."""
        head = replace(self.head, kind=NounKind.ABSTRACT) if inner.counts else self.head
        return replace(self.with_extra("of", inner.text), tokens=(*self.tokens[:-1], head), of_kind=inner.kind)

    def replace_one(self, meant: Phrase) -> Phrase:
        """Replaces "one" by the noun of `meant`, and keeps the adjectives before "one"."""
        noun = [t for t in meant.tokens if not t.adjective and not _is_determiner(t)] or [meant.head]
        single = self.head.word == "one" and meant.plural
        last = replace(noun[-1], text=noun[-1].lemma, tag="NN") if single else noun[-1]
        return replace(self, tokens=(*self.tokens[:-1], *noun[:-1], last), extra=(*meant.extra, *self.extra))

    def _determined(self) -> bool:
        return any(t.relation in ("det", "poss") for t in self.tokens)

    @property
    def content(self) -> tuple[Token, ...]:
        """Words of the phrase without article, possessive and number."""
        *left, head = self.tokens
        units = {n for n in range(len(left)) if self._measures(n)}
        mine = {n for n, t in enumerate(left) if t.tag == "POS" and left[n - 1].tag not in ("PRP$", "PRP")}
        order = [t for each in self.relations for t in each.before]
        return (*(t for n, t in enumerate(left) if n in units | mine or not (_is_determiner(t) or t in order)), head)

    def _numerals(self) -> Iterator[tuple[str, ...]]:
        """Yields each number that counts objects, without numbers in measures ("ten inch nails")."""
        left = [t for n, t in enumerate(self.tokens[:-1]) if not self._measures(n)]
        for numeral, run in groupby(self.tokens if self.counts else left, key=_is_numeral):
            if numeral:
                yield tuple(t.word for t in run)

    def _measures(self, at: int) -> bool:
        """Returns whether the number at a position belongs to a unit of measure."""
        unit = at + 2 < len(self.tokens) and self.tokens[at + 1].word in word_list("units")
        return unit and number_of_word(self.tokens[at].word) is not None


def _joined_text(words: Sequence[Token | str]) -> str:
    """Joins words by blanks, except before the "'s" of a possessive."""
    said = ((word.text, word.tag == "POS") if isinstance(word, Token) else (word, False) for word in words)
    return "".join(text if owner else f" {text}" for text, owner in said).lstrip()


def _is_numeral(token: Token) -> bool:
    digits = token.tag == "CD" or _DIGITS.fullmatch(token.text) is not None
    return digits or number_of_word(token.word) is not None


def _is_determiner(token: Token) -> bool:
    named = token.word in word_list("vague_numbers") | word_list("pointing") | {"-"}
    tagged = token.pos == "DET" or token.tag in ("PRP$", "DT", "PDT", "POS", "WP$")
    return named or tagged or number_of_word(token.word) is not None


def noun_phrases(tokens: Sequence[Token]) -> dict[int, Phrase]:
    """Finds all noun phrases, which do not overlap; returns them by the index of the first word."""
    phrases: list[Phrase] = []
    start = len(tokens)
    for head in reversed(tokens):
        if head.index < start and _is_head(head, tokens):
            begins = (n for n in range(head.index, 0, -1) if not _belongs(tokens[n - 1], head, tokens))
            start = next(begins, 0)
            phrases.append(Phrase(tuple(tokens[start : head.index + 1])))
    joined: list[Phrase] = []
    for phrase in reversed(phrases):
        before = joined[-1] if joined else None
        if before is not None and before.head.index + 1 == phrase.tokens[0].index and _compound(before, phrase):
            joined[-1] = Phrase((*before.tokens, *phrase.tokens))
        else:
            joined.append(phrase)
    return {phrase.tokens[0].index: phrase for phrase in joined}


def _compound(before: Phrase, phrase: Phrase) -> bool:
    """Returns whether two adjacent nouns without an article form one phrase, such as "kitchen" and "counter"."""
    if before.head.lemma in word_list("people") and phrase.named_person and phrase.proper:
        return before.head.pos in ("NOUN", "PROPN") and not before.plural
    nouns = before.head.pos == "NOUN" and all(t.pos == "NOUN" for t in phrase.tokens)
    return nouns and not before.plural and not before.person and before.head.kind is not NounKind.PERSON


def _is_head(token: Token, tokens: Sequence[Token]) -> bool:
    """Returns whether a phrase ends with this word."""
    if token.tag in ("EX", "WDT", "WP") or token.relation == "nummod":
        return False
    parent = tokens[token.head]
    inside = token.relation in _LEFT and parent.index > token.index
    inside = inside and all(t.relation in _LEFT and t.word != "," for t in tokens[token.index + 1 : parent.index])
    nominal = token.pos in _NOMINAL or (token.pos in ("ADJ", "DET") and token.relation in _HEADLIKE)
    return nominal and not inside


def _belongs(token: Token, head: Token, tokens: Sequence[Token]) -> bool:
    """Returns whether a word before `head` depends on it directly or through other words of the phrase."""
    for _ in range(_DEEPEST):
        if token.relation not in _LEFT or token.word == "," or token.word in word_list("loose"):
            return False
        token = tokens[token.head]
        if token.index >= head.index:
            return token.index == head.index
    return False
