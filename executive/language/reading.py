"""Reading of the words, from left to right, as a row of items."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

from executive.language.indirect import (
    belongs,
    do_we_have,
    goes_on,
    how_many,
    narrated,
    needed,
    reported_speech,
    what_is,
    where_is,
)
from executive.language.items import (
    LONGEST,
    Adverb,
    Being,
    Chunk,
    Correction,
    Item,
    Negation,
    Outside,
    Row,
    Separator,
    Unknown,
    Verb,
    Whether,
    command_position,
)
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token

_SEPARATORS: Final = frozenset({",", "and", "or", "then", ";"})
_VERB_TAGS: Final = frozenset({"VB", "VBP", "VBD", "VBN"})
_HAVING: Final = frozenset({"with", "containing", "holding"})
_WITHIN: Final = frozenset({"in", "on"})
_INSIDE: Final = "inside"
_FROM: Final = frozenset({"of", "from"})
_AFTER: Final = frozenset({"after", "upon", "by"})
_LIKE: Final = "like"
_SIDES: Final = frozenset({"left", "right"})
_SHOWN: Final = frozenset({"that", "this", "those", "these"})
_WHO: Final = frozenset({"who", "that", "which"})
_IS: Final = frozenset({"is", "'s", "are", "'re"})
_OF_ALL: Final = re.compile(r"all|none|(?:any|every|no)(?:where|one|body|thing)")
"""Behind these "but" means "except"."""


class _Reader(Row):
    """Reads the row from left to right."""

    def read(self, lead: Sequence[Item] = ()) -> Iterable[Item]:
        """The items of the row in order, behind `lead`; the first way of reading that fits takes its words."""
        facts = (reported_speech, narrated, needed, belongs, goes_on)
        steps: tuple[Callable[[list[Item]], Item | None], ...] = (
            self._mark,
            *(partial(step, self) for step in (where_is, how_many, what_is, do_we_have, *facts)),
            self._verb,
            self._being,
            self._chunk,
            self._small,
            self._outside,
        )
        items = list(lead)
        while self.at < len(self.tokens):
            if self.at in self.silent:
                self.at += 1
                continue
            item = next((found for step in steps if (found := step(items)) is not None), None)
            items.append(item if item is not None else self._unknown())
        return items

    def _mark(self, items: list[Item]) -> Item | None:
        """What takes something back: "not", "no, the hammer"."""
        correction, negation = (self.match(lexicon().corrections), self.match(lexicon().negations))
        if correction is not None and len(correction) >= len(negation or ()) and self._is_correction(len(correction)):
            self.at += len(correction)
            return Correction(" ".join(correction), lexicon().corrections[correction])
        if negation is not None:
            self.at += len(negation)
            return Negation(" ".join(negation))
        return None

    def _is_correction(self, length: int) -> bool:
        """Whether "no" is none that belongs to a noun ("no milk")."""
        behind = self.tokens[self.at + length : self.at + length + 1]
        return self.tokens[self.at].word != "no" or length > 1 or not behind or behind[0].pos not in ("NOUN", "ADJ")

    def _verb(self, items: list[Item]) -> Item | None:
        found = self.match(lexicon().verbs) or self._gerund(items)
        if found is not None and self._takes_preposition(found):
            found = found[:-1]
        if found is None or not self._is_verb(items, len(found)):
            return None
        self.at += len(found)
        return Verb(" ".join(found), lexicon().verbs[found])

    def _takes_preposition(self, verb: tuple[str, ...]) -> bool:
        """Whether the last word of a verb rather begins a longer preposition ("go | in front of")."""
        if verb[:-1] not in lexicon().verbs:
            return False
        start = self.at + len(verb) - 1
        place = self.phrase_at(start + 1)
        if verb[-1] in _WITHIN and place is not None and place.kind is NounKind.PLACE:
            return True
        ahead = tuple(t.word for t in self.tokens[start : start + LONGEST])
        return any(ahead[:n] in lexicon().prepositions for n in range(2, len(ahead) + 1))

    def _gerund(self, items: list[Item]) -> tuple[str, ...] | None:
        """A verb that stands as "bringing" or "brought" where a command begins, as behind "would you mind"."""
        first = self.tokens[self.at]
        past = first.tag in ("VBD", "VBN") and not items
        if not (past or (first.tag == "VBG" and command_position(items))):
            return None
        spoken = (first.lemma, *(t.word for t in self.tokens[self.at + 1 : self.at + LONGEST]))
        return next((spoken[:n] for n in range(len(spoken), 0, -1) if spoken[:n] in lexicon().verbs), None)

    def _is_verb(self, items: list[Item], length: int) -> bool:
        token = self.tokens[self.at]
        inside = any(start < self.at < start + len(p.tokens) for start, p in self.phrases.items())
        if token.pos == "VERB" and token.tag in _VERB_TAGS and not inside:
            return True
        following = self.tokens[self.at + length : self.at + length + 1]
        return command_position(items) and bool(following) and following[0].word not in _SEPARATORS

    def _being(self, items: list[Item]) -> Item | None:
        token = self.tokens[self.at]
        after = self.tokens[self.at + 1 : self.at + 2]
        modal = int(token.tag == "MD" and bool(after) and after[0].word == "be")
        if modal or (token.lemma == "be" and token.pos in ("AUX", "VERB") and self.match(lexicon().fillers) is None):
            second = self.tokens[self.at + 1 + modal : self.at + 2 + modal]
            existential = bool(second) and second[0].tag == "EX"
            return Being(self.take(1 + modal + existential), existential, asked=not modal)
        if token.tag == "EX" or (token.word == "there" and after and after[0].lemma == "be"):
            verb = next((t.index for t in self.tokens[self.at + 1 : self.at + 4] if t.lemma == "be"), self.at)
            return Being(self.take(verb + 1 - self.at), existential=True, asked=False)
        return None

    def _chunk(self, items: list[Item]) -> Item | None:
        preposition = self.match(lexicon().prepositions) or ()
        start = self.at + len(preposition)
        phrase = self.phrase_at(start) or self._shown_at(start)
        if phrase is None:
            return None if preposition else self._level(items)
        self.at = start + len(phrase.tokens)
        if len(phrase.tokens) > 1 and phrase.tokens[0].word == "no":
            return Unknown(phrase.spoken)
        phrase = self._described(self._numbered(self._of(phrase)))
        role = lexicon().prepositions[preposition] if preposition else None
        return Chunk(phrase, " ".join(preposition), role)

    def _level(self, items: list[Item]) -> Item | None:
        """ "Upstairs": where to, or where to look; before a place it says nothing more."""
        token = self.tokens[self.at]
        if token.word not in lexicon().levels:
            return None
        self.at += 1
        ahead = self.tokens[self.at : self.at + 1]
        if ahead and ahead[0].word != "for" and (ahead[0].pos == "ADP" or ahead[0].tag in ("TO", "IN")):
            return Separator("")
        if items and isinstance(items[-1], Chunk) and items[-1].role is not None:
            return Separator("")
        verb = next((item for item in reversed(items) if isinstance(item, Verb | Being)), None)
        looks = not isinstance(verb, Verb) or VerbKind.FIND in verb.kinds
        role = PrepositionRole.AT if looks else PrepositionRole.GOAL
        return Chunk(Phrase((replace(token, pos="NOUN", tag="NN", kind=NounKind.PLACE),)), "", role)

    def _shown_at(self, start: int) -> Phrase | None:
        """The noun phrase behind a "that" which was not read as its article ("hand me that cup")."""
        shown = start < len(self.tokens) and self.tokens[start].word in _SHOWN
        phrase = self.phrase_at(start + 1) if shown else None
        if phrase is None or phrase.named_person or phrase.head.word in lexicon().subjects:
            return None
        return Phrase((replace(self.tokens[start], tag="DT", pos="DET"), *phrase.tokens))

    def _of(self, phrase: Phrase) -> Phrase:
        """Join "of wine" to a bottle, and "of cups" to "two" or "a couple"."""
        while self.at < len(self.tokens) and self.tokens[self.at].word == "of":
            inner = self.phrase_at(self.at + 1)
            if inner is None:
                break
            self.at += 1 + len(inner.tokens)
            whole = phrase.counts or phrase.head.word in ("all", "both")
            phrase = replace(inner, tokens=(*phrase.tokens, *inner.tokens)) if whole else phrase.consisting_of(inner)
        return phrase

    def _numbered(self, phrase: Phrase) -> Phrase:
        """Join the number of a place: "room four"."""
        token = self.tokens[self.at] if self.at < len(self.tokens) else None
        behind = self.tokens[self.at + 1 : self.at + 2]
        counts = bool(behind) and behind[0].pos in ("NOUN", "ADJ", "PROPN")
        countable = phrase.kind in (NounKind.PLACE, NounKind.THING) and not (phrase.plural or phrase.pronoun)
        if token is None or token.tag != "CD" or not countable or counts:
            return phrase
        self.at += 1
        return phrase.with_extra(token.text)

    def _described(self, phrase: Phrase) -> Phrase:
        """Join what tells somebody or something apart: what they do, what they wear, what it has."""
        while (end := self._description_end(phrase)) > self.at:
            phrase = phrase.with_extra(*(t.text for t in self.tokens[self.at : end] if t.tag != "DT"))
            self.at = end
        return phrase

    def _description_end(self, phrase: Phrase) -> int:
        """Where a description that begins here ends."""
        if self.at >= len(self.tokens):
            return self.at
        if phrase.person:
            self._skip_relative()
        token = self.tokens[self.at]
        if phrase.person and token.tag == "VBG":
            return self._doing_end()
        side = self.phrase_at(self.at + 1) if token.word == "on" else None
        if side is not None and side.head.word in _SIDES:
            end = self.at + 1 + len(side.tokens)
            return end if end == len(self.tokens) or self.tokens[end].word != "of" else self.at
        joins = token.word in _HAVING or (phrase.person and token.word in ("in", "wearing") and self._worn())
        inner = self.phrase_at(self.at + 1) if joins else None
        if inner is None or inner.person or inner.speaker or inner.pronoun:
            return self.at
        return self.at + 1 + len(inner.tokens)

    def _skip_relative(self) -> None:
        """Leave out "who is" before what somebody does or wears."""
        here = tuple(t.word for t in self.tokens[self.at : self.at + 2])
        after = self.tokens[self.at + 2 : self.at + 3]
        if len(here) == 2 and here[0] in _WHO and here[1] in _IS and after and after[0].tag in ("VBG", "IN"):
            self.at += 2

    def _worn(self) -> bool:
        """Whether what stands behind the next word is worn: clothes, or a colour."""
        inner = self.phrase_at(self.at + 1)
        return inner is not None and inner.head.lemma in lexicon().worn

    def _doing_end(self) -> int:
        """The end of "raising their left arm" or "wearing a blue shirt": what is done, and in which direction."""
        end = self.at + 1
        inner = self.phrase_at(end)
        if inner is not None and not inner.person:
            end += len(inner.tokens)
        while end < len(self.tokens) and (more := self._directional(end)):
            end += more
        return end

    def _directional(self, start: int) -> int:
        """How many words from `start` on tell a direction or a posture."""
        if self.tokens[start].relation == "prt":
            return 1
        preposition = int(self.tokens[start].pos in ("ADP", "PART"))
        phrase = self.phrase_at(start + preposition)
        if phrase is None or phrase.head.lemma not in lexicon().directions:
            return 0
        return preposition + len(phrase.tokens)

    def _small(self, items: list[Item]) -> Item | None:
        token = self.tokens[self.at]
        if token.word in lexicon().there and self._points(items):
            self.at += 1
            return Separator("")
        behind = self.tokens[self.at + 1 : self.at + 2]
        if token.word == _LIKE and self._wanting(items) and self.phrase_at(self.at + 1):
            self.at += 1
            return Separator("")
        if self._purpose(items) or (not items and token.word in _AFTER and behind and behind[0].tag == "VBG"):
            self.at += 1
            return Separator("")
        if token.tag == "RB" and token.word in lexicon().manners:
            self.at += 1
            return Separator(token.word)
        if token.pos in ("ADP", "ADV") and token.word not in _FROM and behind and behind[0].word in ("here", "there"):
            self.at += 1
            return Separator("")
        if token.word == _INSIDE and self._first_told(items):
            self.at += 1
            return Chunk(Phrase((replace(token, pos="NOUN", tag="NN", kind=NounKind.PLACE),)), "", PrepositionRole.GOAL)
        if token.word in lexicon().here or token.word in lexicon().there:
            self.at += 1
            return Adverb(here=token.word in lexicon().here)
        if token.word in ("if", "whether"):
            self.at += 1
            return Whether()
        if token.word == "but" and self.at > 0 and _OF_ALL.fullmatch(self.tokens[self.at - 1].word):
            return None
        filler = self._particle(items) or self.match(lexicon().fillers)
        if filler is None:
            return None
        self.at += len(filler)
        return Separator(" ".join(filler))

    def _first_told(self, items: Sequence[Item]) -> bool:
        """Whether "inside" is the house itself: no place was spoken of, and the thing was said by its name."""
        chunks = [item for item in items if isinstance(item, Chunk)]
        named = bool(chunks) and not chunks[-1].phrase.pronoun
        return named and all(chunk.role is None for chunk in chunks) and not any(isinstance(i, Being) for i in items)

    def _purpose(self, items: Sequence[Item]) -> bool:
        """Whether "to" stands between going and what is gone for ("go to take the broom")."""
        last = next((item for item in reversed(items) if isinstance(item, Verb | Being | Outside)), None)
        going = isinstance(last, Verb) and VerbKind.GO in last.kinds
        behind = self.ahead()
        verb = bool(behind) and behind[0].tag == "VB" and (behind[0].word,) in lexicon().verbs
        return going and verb and self.tokens[self.at].tag == "TO"

    def _wanting(self, items: Sequence[Item]) -> bool:
        """Whether what is wanted comes next, so that "like" says nothing ("I need like a towel")."""
        asked = isinstance(items[-1], Verb) if items else False
        return asked or (bool(items) and self.tokens[self.at - 1].word in ("me", "us"))

    def _points(self, items: Sequence[Item]) -> bool:
        """Whether "over there" only goes with a "that", as in "that clamp over there"."""
        thing = next((item for item in reversed(items) if not isinstance(item, Separator)), None)
        if not isinstance(thing, Chunk) or thing.role is not None or not self._beyond():
            return False
        return thing.phrase.tokens[0].word in _SHOWN and not thing.phrase.pronoun

    def _beyond(self) -> bool:
        """Whether "over" stands before the next word, or a preposition behind it."""
        behind = self.ahead()
        return self.tokens[self.at - 1].word == "over" or (bool(behind) and behind[0].tag == "IN")

    def _particle(self, items: list[Item]) -> tuple[str, ...] | None:
        """Join a particle to its verb: "put the cup down"."""
        at = next((n for n in range(len(items) - 1, -1, -1) if isinstance(items[n], Verb)), None)
        verb = None if at is None else items[at]
        particle = self.tokens[self.at].word
        if at is None or not isinstance(verb, Verb) or (*verb.text.split(), particle) not in lexicon().verbs:
            return None
        behind = self.tokens[self.at + 1 : self.at + 2]
        if behind and behind[0].word in lexicon().here | lexicon().there:
            return None
        items[at] = Verb(f"{verb.text} {particle}", lexicon().verbs[(*verb.text.split(), particle)])
        return (particle,)

    def _outside(self, items: list[Item]) -> Item | None:
        """A verb that the robot does not know, where a clause may begin."""
        token = self.tokens[self.at]
        if token.pos != "VERB" or token.tag not in _VERB_TAGS or not (command_position(items) or token.tag == "VB"):
            return None
        self.at += 1
        return Outside(token.text)

    def _unknown(self) -> Unknown:
        token = self.tokens[self.at]
        self.at += 1
        return Unknown(token.text)


def split_items(
    tokens: Sequence[Token],
    phrases: Mapping[int, Phrase],
    *,
    lead: Sequence[Item] = (),
    silent: Collection[int] = (),
) -> tuple[Item, ...]:
    """The sentence as items, in order; every word is in one of them, but those in `silent`. `lead` comes before it."""
    return tuple(_Reader(tokens, phrases, silent=set(silent)).read(lead))
