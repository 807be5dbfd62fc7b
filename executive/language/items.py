"""The sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Attachment of prepositions is where parsers err most; the row keeps the order of the words, and the verbs decide later
which place plays which role.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from executive.language.lexicon import Lexicon, PrepositionRole, VerbKind
from executive.language.parser import Token
from executive.language.phrases import Phrase

__all__ = ["Adverb", "Being", "Chunk", "Item", "Separator", "Unknown", "Verb", "Whether", "split_items", "spoken_words"]

_SEPARATORS: Final = frozenset({",", "and", "or", "then", ";"})
_VERB_TAGS: Final = frozenset({"VB", "VBP", "VBD", "VBN"})
_LONGEST: Final = 6


@dataclass(frozen=True)
class Verb:
    """A verb that the robot understands, with its particles."""

    text: str
    kinds: frozenset[VerbKind]


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
    """A form of "to be" as spoken; `existential` with "there", `asked` when it stands before its subject."""

    text: str
    existential: bool
    asked: bool


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


Item = Verb | Chunk | Adverb | Being | Whether | Separator | Unknown


@dataclass
class _Reader:
    """Reads the row from left to right."""

    tokens: Sequence[Token]
    phrases: Mapping[int, Phrase]
    words: Lexicon
    at: int = 0

    def read(self) -> Iterable[Item]:
        steps = (self._verb, self._being, self._chunk, self._small)
        items: list[Item] = []
        while self.at < len(self.tokens):
            item = next((found for step in steps if (found := step(items)) is not None), None)
            items.append(item if item is not None else self._unknown())
        return items

    def _match(self, phrases: Iterable[tuple[str, ...]], lemma: bool = False) -> tuple[str, ...] | None:
        """The longest of the phrases that stands here."""
        for length in range(_LONGEST, 0, -1):
            piece = self.tokens[self.at : self.at + length]
            spoken = tuple(t.word for t in piece)
            if len(piece) == length and spoken in phrases:
                return spoken
        return None

    def _verb(self, items: list[Item]) -> Item | None:
        found = self._match(self.words.verbs)
        if found is None or not self._is_verb(items, len(found)):
            return None
        self.at += len(found)
        return Verb(" ".join(found), self.words.verbs[found])

    def _is_verb(self, items: list[Item], length: int) -> bool:
        token = self.tokens[self.at]
        inside = any(start < self.at < start + len(p.tokens) for start, p in self.phrases.items())
        if token.pos == "VERB" and token.tag in _VERB_TAGS and not inside:
            return True
        following = self.tokens[self.at + length : self.at + length + 1]
        return _command_position(items) and bool(following) and following[0].word not in _SEPARATORS

    def _being(self, items: list[Item]) -> Item | None:
        token = self.tokens[self.at]
        after = self.tokens[self.at + 1 : self.at + 2]
        modal = int(token.tag == "MD" and bool(after) and after[0].word == "be")
        if modal or (token.lemma == "be" and token.pos in ("AUX", "VERB") and self._match(self.words.fillers) is None):
            second = self.tokens[self.at + 1 + modal : self.at + 2 + modal]
            existential = bool(second) and second[0].tag == "EX"
            return Being(self._words(1 + modal + existential), existential, asked=not modal)
        if token.tag == "EX" or (token.word == "there" and after and after[0].lemma == "be"):
            verb = next((t.index for t in self.tokens[self.at + 1 : self.at + 4] if t.lemma == "be"), self.at)
            return Being(self._words(verb + 1 - self.at), existential=True, asked=False)
        return None

    def _words(self, count: int) -> str:
        """The next words, which are then read."""
        self.at += count
        return " ".join(t.text for t in self.tokens[self.at - count : self.at])

    def _chunk(self, items: list[Item]) -> Item | None:
        preposition = self._match(self.words.prepositions) or ()
        start = self.at + len(preposition)
        phrase = self._phrase_at(start)
        if phrase is None:
            return None
        self.at = start + len(phrase.tokens)
        phrase = self._of(phrase)
        phrase = self._description(phrase)
        role = self.words.prepositions[preposition] if preposition else None
        return Chunk(phrase, " ".join(preposition), role)

    def _phrase_at(self, start: int) -> Phrase | None:
        """The noun phrase that begins at `start`, also when what came before took its first words."""
        whole = self.phrases.get(start)
        if whole is not None:
            return whole
        cut = next((p for first, p in self.phrases.items() if first < start < first + len(p.tokens)), None)
        return None if cut is None else Phrase(tuple(t for t in cut.tokens if t.index >= start))

    def _of(self, phrase: Phrase) -> Phrase:
        """Join "of wine" to a bottle, and "of cups" to "two" or "a couple"."""
        while self.at < len(self.tokens) and self.tokens[self.at].word == "of":
            inner = self._phrase_at(self.at + 1)
            if inner is None:
                break
            self.at += 1 + len(inner.tokens)
            phrase = phrase.counting(inner) if phrase.counts else phrase.with_extra("of", inner.text, *inner.extra)
        return phrase

    def _description(self, phrase: Phrase) -> Phrase:
        """Join what somebody is doing to them: "the person raising their left arm"."""
        if not phrase.person or self.at >= len(self.tokens) or self.tokens[self.at].tag != "VBG":
            return phrase
        end = self.at + 1
        while end < len(self.tokens) and (inner := self._directional(end)):
            end += inner
        words = [t.text for t in self.tokens[self.at : end]]
        self.at = end
        return phrase.with_extra(*words)

    def _directional(self, start: int) -> int:
        """How many words from `start` on tell a direction or a posture."""
        if self.tokens[start].relation == "prt":
            return 1
        preposition = int(self.tokens[start].pos in ("ADP", "PART"))
        phrase = self._phrase_at(start + preposition)
        if phrase is None or phrase.head.lemma not in self.words.directions:
            return 0
        return preposition + len(phrase.tokens)

    def _small(self, items: list[Item]) -> Item | None:
        token = self.tokens[self.at]
        if token.word in self.words.here or token.word in self.words.there:
            self.at += 1
            return Adverb(here=token.word in self.words.here)
        if token.word in ("if", "whether"):
            self.at += 1
            return Whether()
        filler = self._particle(items) or self._match(self.words.fillers)
        if filler is None:
            return None
        self.at += len(filler)
        return Separator(" ".join(filler))

    def _particle(self, items: list[Item]) -> tuple[str, ...] | None:
        """Join a particle to its verb: "put the cup down"."""
        at = next((n for n in range(len(items) - 1, -1, -1) if isinstance(items[n], Verb)), None)
        verb = None if at is None else items[at]
        particle = self.tokens[self.at].word
        if at is None or not isinstance(verb, Verb) or (*verb.text.split(), particle) not in self.words.verbs:
            return None
        items[at] = Verb(f"{verb.text} {particle}", self.words.verbs[(*verb.text.split(), particle)])
        return (particle,)

    def _unknown(self) -> Unknown:
        token = self.tokens[self.at]
        self.at += 1
        return Unknown(token.text)


def _command_position(items: Sequence[Item]) -> bool:
    """Whether a command may begin behind these items."""
    return not items or isinstance(items[-1], Separator)


def split_items(tokens: Sequence[Token], phrases: Mapping[int, Phrase], words: Lexicon) -> tuple[Item, ...]:
    """The sentence as items, in order; every word is in one of them."""
    return tuple(_Reader(tokens, phrases, words).read())


def spoken_words(items: Iterable[Item]) -> str:
    """The words of the items as spoken, small words left out."""
    words = (
        item.spoken if isinstance(item, Chunk) else getattr(item, "word", getattr(item, "text", ""))
        for item in items
        if not isinstance(item, Separator)
    )
    return " ".join(filter(None, words))
