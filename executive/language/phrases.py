"""Noun phrases: which words belong together around a noun, and what they say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from executive.command import Thing
from executive.language.lexicon import lexicon
from executive.language.parser import Token

__all__ = ["Phrase", "noun_phrases"]

_LEFT: Final = frozenset(
    {"det", "amod", "compound", "nummod", "poss", "nmod", "predet", "quantmod", "advmod", "case", "npadvmod", "punct"}
)
_NOMINAL: Final = frozenset({"NOUN", "PROPN", "PRON", "NUM", "X"})
_NUMBERS: Final[Mapping[str, int]] = {
    word: number
    for number, word in enumerate("zero one two three four five six seven eight nine ten eleven twelve".split())  # noqa: SIM905
} | {"couple": 2, "dozen": 12}
_DEEPEST: Final = 6
_HEADLIKE: Final = frozenset({"obj", "iobj", "obl", "nsubj", "attr", "conj", "root"})


@dataclass(frozen=True)
class Phrase:
    """A noun with what stands around it; `extra` are the words joined behind it ("of wine")."""

    tokens: tuple[Token, ...]
    extra: tuple[str, ...] = ()

    @property
    def head(self) -> Token:
        """The noun."""
        return self.tokens[-1]

    @property
    def text(self) -> str:
        """The words as spoken, without article, possessive and number."""
        return " ".join((*(t.text for t in self._content()), *self.extra))

    @property
    def singular(self) -> str:
        """The same with the noun in its dictionary form."""
        *left, head = self._content()
        return " ".join((*(t.text for t in left), head.lemma, *self.extra))

    @property
    def thing(self) -> Thing:
        """The phrase as a thing: leading adjectives are attributes."""
        words = self._content()
        leads = (n for n, t in enumerate(words[:-1]) if not t.adjective)
        first = next(leads, len(words) - 1)
        name = " ".join((*(t.text for t in words[first:]), *self.extra))
        return Thing(name, tuple(t.text for t in words[:first]))

    @property
    def plural(self) -> bool:
        """Whether the noun stands in the plural."""
        return self.head.tag in ("NNS", "NNPS")

    @property
    def count(self) -> int:
        """The number said; 1 for a singular, 0 for a plural without a number."""
        said = next((n for n in map(_number, self.tokens[:-1]) if n is not None), None)
        return said if said is not None else 0 if self.plural else 1

    @property
    def pronoun(self) -> bool:
        """Whether it stands for something said before."""
        return len(self.tokens) == 1 and self.head.word in lexicon().pronouns

    @property
    def speaker(self) -> bool:
        """Whether it is who speaks."""
        return len(self.tokens) == 1 and self.head.word in lexicon().speaker

    @property
    def person(self) -> bool:
        """Whether it is somebody: a noun for people, or a person's name."""
        return self.head.lemma in lexicon().people or self.head.word in lexicon().people or self.named_person

    @property
    def named_person(self) -> bool:
        """Whether it is a person's name."""
        return self.head.entity == "PERSON" and self.head.pos == "PROPN" and not self._determined()

    @property
    def universal(self) -> bool:
        """Whether it means all of a kind ("everyone", "all the men")."""
        return any(t.word in lexicon().everyone for t in self.tokens)

    @property
    def intangible(self) -> bool:
        """Whether it is nothing that a hand can hold or that one can go to ("the news", "six o'clock")."""
        words = lexicon().intangible
        return any(word in words for word in (self.head.lemma, self.head.word, *self.extra))

    @property
    def spoken(self) -> str:
        """All words as spoken."""
        return " ".join((*(t.text for t in self.tokens), *self.extra))

    @property
    def counts(self) -> bool:
        """Whether it is only a number ("two", "a couple")."""
        return _number(self.head) is not None

    def counting(self, counted: Phrase) -> Phrase:
        """The phrase of so many of what is counted."""
        return Phrase((*self.tokens, *counted.tokens), counted.extra)

    def with_extra(self, *words: str) -> Phrase:
        """The phrase with more words behind the noun."""
        return Phrase(self.tokens, (*self.extra, *words))

    def _determined(self) -> bool:
        return any(t.relation in ("det", "poss") for t in self.tokens)

    def _content(self) -> tuple[Token, ...]:
        *left, head = self.tokens
        return (*(t for t in left if not _is_determiner(t)), head)


def _is_determiner(token: Token) -> bool:
    said_number = _number(token) is not None
    return said_number or token.pos == "DET" or token.tag in ("PRP$", "DT", "PDT", "POS", "WP$") or token.text == "-"


def _number(token: Token) -> int | None:
    if token.word.isdecimal() and len(token.word) < 4:
        return int(token.word)
    return _NUMBERS.get(token.word)


def noun_phrases(tokens: Sequence[Token]) -> dict[int, Phrase]:
    """All noun phrases by the index of their first word; they do not overlap."""
    phrases: dict[int, Phrase] = {}
    end = len(tokens)
    for head in reversed(tokens):
        if head.index < end and _is_head(head, tokens):
            start = _first(head, tokens)
            phrases[start] = Phrase(tuple(tokens[start : head.index + 1]))
            end = start
    return phrases


def _is_head(token: Token, tokens: Sequence[Token]) -> bool:
    """Whether a phrase ends with this word."""
    if token.tag in ("EX", "WDT", "WP") or token.relation == "nummod":
        return False
    parent = tokens[token.head]
    inside = token.relation in _LEFT and parent.index > token.index and _joined(token, parent, tokens)
    nominal = token.pos in _NOMINAL or (token.pos in ("ADJ", "DET") and token.relation in _HEADLIKE)
    return nominal and not inside


def _joined(token: Token, parent: Token, tokens: Sequence[Token]) -> bool:
    """Whether only words of one noun phrase stand between `token` and the noun behind it."""
    return all(t.relation in _LEFT and t.word != "," for t in tokens[token.index + 1 : parent.index])


def _first(head: Token, tokens: Sequence[Token]) -> int:
    """Where the phrase of `head` begins: the words before it that depend on it, directly or not."""
    first = head.index
    while first > 0 and _belongs(tokens[first - 1], head, tokens):
        first -= 1
    return first


def _belongs(token: Token, head: Token, tokens: Sequence[Token]) -> bool:
    """Whether a word before `head` depends on it through words of its own phrase only."""
    for _ in range(_DEEPEST):
        if token.relation not in _LEFT or token.word == ",":
            return False
        token = tokens[token.head]
        if token.index >= head.index:
            return token.index == head.index
    return False
